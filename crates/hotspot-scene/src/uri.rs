//! URIs as glTF uses them: percent-encoded relative references and embedded data (RFC 3986, RFC 2397).

use base64::Engine;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};

use crate::budget::Budget;
use crate::error::{REEXPORT, Result, invalid};

/// Padding is left out by some exporters.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// True for `data:` URIs, whose scheme is case-insensitive.
pub(crate) fn is_data(uri: &str) -> bool {
    uri.get(..5).is_some_and(|scheme| scheme.eq_ignore_ascii_case("data:"))
}

/// The bytes of a `data:` URI.
pub(crate) fn decode_data(uri: &str, budget: &Budget, element: &str) -> Result<Vec<u8>> {
    let wrong = |problem: String| invalid(element, problem, REEXPORT);
    let rest = uri.get(5..).unwrap_or_default();
    let (head, payload) = rest.split_once(',').ok_or_else(|| wrong("the data URI has no comma".into()))?;
    budget.charge(payload.len() as u64, 1, element)?;
    let is_base64 = head.rsplit(';').next().is_some_and(|last| last.eq_ignore_ascii_case("base64"));
    if is_base64 {
        BASE64.decode(payload).map_err(|error| wrong(format!("the data URI is not base64 ({error})")))
    } else {
        Ok(percent_encoding::percent_decode_str(payload).collect())
    }
}

/// A relative reference as a path.
pub(crate) fn decode_path(uri: &str, element: &str) -> Result<String> {
    percent_encoding::percent_decode_str(uri).decode_utf8().map(Into::into).map_err(|_| {
        invalid(
            element,
            format!("\"{uri}\" does not decode to UTF-8"),
            "rename the file or percent-encode its name as UTF-8",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_uris_decode_with_and_without_padding_and_type() {
        let budget = Budget::new(1000);
        for uri in ["data:application/octet-stream;base64,AQI=", "data:;base64,AQI", "DATA:,%01%02"] {
            assert!(is_data(uri));
            assert_eq!(decode_data(uri, &budget, "buffers[0].uri").unwrap(), [1, 2], "{uri}");
        }
        for uri in ["data:", "data:;base64,A", "data:;base64,A*=="] {
            let error = decode_data(uri, &budget, "buffers[0].uri").unwrap_err().to_string();
            assert!(error.contains("buffers[0].uri"), "{error}");
        }
        assert!(!is_data("dät"));
    }

    #[test]
    fn paths_must_decode_to_utf8() {
        assert_eq!(decode_path("a%20b%C3%A9.bin", "x").unwrap(), "a bé.bin");
        assert!(decode_path("a%FF.bin", "images[0].uri").unwrap_err().to_string().contains("UTF-8"));
    }
}
