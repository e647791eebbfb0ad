//! A choice of metrics: what `--metrics` asks for.

use crate::metric::Metric;

/// A set of metrics, and whether ledgers are wanted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MetricSet {
    bits: u32,
    ledgers: bool,
}

/// A name that is neither a metric nor a group.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no metric or group is named \"{name}\"; the names are {}", MetricSet::names().join(", "))]
pub struct UnknownMetric {
    /// The name as given.
    pub name: String,
}

impl MetricSet {
    /// Every metric, ledgers too.
    pub const ALL: Self = Self { bits: (1 << Metric::ALL.len()) - 1, ledgers: true };
    /// None: radiance alone.
    pub const NONE: Self = Self { bits: 0, ledgers: false };

    const GROUPS: [(&'static str, &'static [Metric]); 5] = [
        ("rays", &[Metric::Rays]),
        (
            "intersection",
            &[
                Metric::Nodes,
                Metric::Shapes,
                Metric::Intersection,
                Metric::Boxes,
                Metric::Leaves,
                Metric::Instances,
                Metric::Waste,
            ],
        ),
        ("time", &[Metric::TimeUs]),
        ("shading", &[Metric::Bsdf, Metric::Texture, Metric::TextureBytes, Metric::AlphaTests]),
        (
            "cause",
            &[Metric::Throughput, Metric::Escaped, Metric::Absorbed, Metric::Roulette, Metric::DepthLimit],
        ),
    ];

    /// Reads a comma-separated list of metric names and groups (`rays`, `intersection`, `time`, `shading`, `cause`,
    /// `ledgers`, `all`, `none`). A metric brings its shadow part with it. Case and blanks around names do not matter.
    ///
    /// # Errors
    /// The first unknown name; [`MetricSet::names`] lists what it could have meant.
    pub fn parse(list: &str) -> Result<Self, UnknownMetric> {
        let mut set = Self::NONE;
        for name in list.split(',').map(|name| name.trim().to_ascii_lowercase()) {
            match name.as_str() {
                "" | "none" => {}
                "all" => set = Self::ALL,
                "ledgers" => set.ledgers = true,
                _ => {
                    if let Some((_, group)) = Self::GROUPS.iter().find(|(group, _)| *group == name) {
                        for metric in *group {
                            set.insert(*metric);
                        }
                    } else if let Some(metric) = Metric::from_name(&name) {
                        set.insert(metric);
                    } else {
                        return Err(UnknownMetric { name });
                    }
                }
            }
        }
        Ok(set)
    }

    /// Every name that [`MetricSet::parse`] takes, groups first: for "did you mean".
    pub fn names() -> Vec<&'static str> {
        let mut names = vec!["all", "none", "ledgers"];
        names.extend(Self::GROUPS.iter().map(|(group, _)| *group));
        for metric in Metric::ALL {
            if !names.contains(&metric.name()) {
                names.push(metric.name());
            }
        }
        names
    }

    /// Adds a metric and its shadow part.
    pub fn insert(&mut self, metric: Metric) {
        self.bits |= 1 << metric as u32;
        if let Some(shadow) = metric.shadow() {
            self.bits |= 1 << shadow as u32;
        }
    }

    /// Whether the metric is in.
    pub const fn contains(self, metric: Metric) -> bool {
        self.bits & (1 << metric as u32) != 0
    }

    /// Whether ledgers are asked for.
    pub const fn ledgers(self) -> bool {
        self.ledgers
    }

    /// Whether nothing at all is asked for.
    pub const fn is_empty(self) -> bool {
        self.bits == 0 && !self.ledgers
    }

    /// Whether ray counts are all that is asked for, so that shadow rays need not be traced when no radiance is wanted.
    pub fn only_rays(self) -> bool {
        self == Self::parse("rays").unwrap_or(Self::NONE)
    }

    /// Its metrics, in the order of [`Metric::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Metric> {
        Metric::ALL.into_iter().filter(move |metric| self.contains(*metric))
    }
}

impl FromIterator<Metric> for MetricSet {
    /// The metrics and their shadow parts.
    fn from_iter<I: IntoIterator<Item = Metric>>(metrics: I) -> Self {
        let mut set = Self::NONE;
        for metric in metrics {
            set.insert(metric);
        }
        set
    }
}

impl Default for MetricSet {
    fn default() -> Self {
        Self::ALL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_names_and_groups() {
        let set = MetricSet::parse("Rays, bsdf").unwrap();
        assert_eq!(set.iter().collect::<Vec<_>>(), [Metric::Rays, Metric::RaysShadow, Metric::Bsdf]);
        assert!(MetricSet::parse("rays").unwrap().only_rays() && !set.only_rays());
        assert_eq!(MetricSet::parse("all").unwrap(), MetricSet::ALL);
        assert!(MetricSet::parse("none").unwrap().is_empty());
        let ledgers = MetricSet::parse("ledgers").unwrap();
        assert!(ledgers.ledgers() && !ledgers.is_empty() && ledgers.iter().next().is_none());
        assert!(MetricSet::parse("intersection").unwrap().contains(Metric::NodesShadow));
    }

    #[test]
    fn the_groups_together_are_everything() {
        let set = MetricSet::parse("rays,intersection,time,shading,cause,ledgers").unwrap();
        assert_eq!(set, MetricSet::ALL);
    }

    #[test]
    fn every_name_offered_is_taken_and_no_other() {
        for name in MetricSet::names() {
            assert!(MetricSet::parse(name).is_ok(), "{name}");
        }
        let error = MetricSet::parse("rays,nods").unwrap_err();
        assert_eq!(error.name, "nods");
        assert!(error.to_string().contains("nodes_shadow"));
    }

    #[test]
    fn metrics_are_found_by_both_their_names() {
        for metric in Metric::ALL {
            assert_eq!(Metric::from_name(metric.name()), Some(metric));
            assert_eq!(Metric::from_name(&metric.layer()), Some(metric));
        }
        assert_eq!(Metric::ALL.map(|metric| metric as usize), std::array::from_fn(|index| index));
        assert_eq!(Metric::from_name("samples"), None);
    }
}
