//! The points before they are scrambled: a (0, 4)-sequence in base 4 made of two (0, 2)-sequences in base 2.
//!
//! Over the field of four elements 0, 1, ω, ω² the powers of Pascal's matrix, C_a = [binom(j, i) a^(j−i)], one for each element
//! a, generate a (0, 4)-sequence in base 4 (Faure 1982, Niederreiter 1987): of 4^k points each box of
//! 4^−d0 × 4^−d1 × 4^−d2 × 4^−d3, d0 + … + d3 = k, holds exactly one. An element is a 2×2 block of bits (ω is the companion
//! matrix of x² + x + 1, and binomials matter modulo 2), so that the matrices are of bits and work as Sobol's do.
//!
//! Multiplying the rows of each digit by an invertible block keeps that property and can be chosen so that dimensions 0, 1 and
//! 2, 3 are (0, 2)-sequences in base 2 besides: of 2^k points one lies in each box of 2^−a × 2^−b, a + b = k. The idea is of
//! Ahmed, Skopenkov, Hadwiger and Wonka, *Analysis and Synthesis of Digital Dyadic Sequences* (2023) and their *SZ Sequences*
//! (2023); the blocks were found by trying all, and the tests in `strata` prove both properties. Dimensions 0 and 1 are Sobol's
//! own; his 2 and 3 are a net of quality t = 3 as a pair, and the four of t = 3 and more.

/// Unscrambled points of indices below 2^16, bits reversed as in `sobol_burley`: the exclusive or of one row by the index's high
/// byte (reversed: the low bits come first) and one by its low byte.
pub(super) struct Table(pub(super) [[[u32; 4]; 256]; 2]);

/// Rows of a 2×2 block of bits; the lowest bit is the left column.
type Block = [u32; 2];

const ONE: Block = [0b01, 0b10];
const OMEGA: Block = [0b10, 0b11];
const OMEGA_SQUARED: Block = [0b11, 0b01];
/// The 2×2 Pascal matrix: what makes dimensions 1 and 3 go with 0 and 2.
const PASCAL: Block = [0b11, 0b10];

const fn product(a: Block, b: Block) -> Block {
    [((a[0] & 1) * b[0]) ^ ((a[0] >> 1) * b[1]), ((a[1] & 1) * b[0]) ^ ((a[1] >> 1) * b[1])]
}

/// a^k for the element of a dimension; `None` is 0.
const fn power(dimension: usize, k: u32) -> Option<Block> {
    match (dimension, k % 3) {
        (0, _) if k > 0 => None,
        (0 | 1, _) | (_, 0) => Some(ONE),
        (2, 1) | (3, 2) => Some(OMEGA),
        _ => Some(OMEGA_SQUARED),
    }
}

/// What bit `bit` of the index adds to a dimension: bit i for row i of the generator matrix.
const fn column(dimension: usize, bit: u32) -> u32 {
    let (digit, half) = (bit / 2, bit % 2);
    let mut column = 0;
    let mut i = 0;
    while i <= digit {
        // binom(digit, i) is odd where i's bits are among the digit's (Lucas).
        if i & !digit == 0
            && let Some(mut block) = power(dimension, digit - i)
        {
            if dimension % 2 == 1 {
                block = product(PASCAL, block);
            }
            column |= (block[0] >> half & 1) << (2 * i);
            column |= (block[1] >> half & 1) << (2 * i + 1);
        }
        i += 1;
    }
    column
}

impl Table {
    pub(super) fn new() -> Self {
        let row = |first_bit: u32, byte: usize| {
            core::array::from_fn(|dimension| {
                // The index is reversed: its bit 0 is the byte's highest.
                (0..8)
                    .filter(|bit| byte >> (7 - bit) & 1 == 1)
                    .fold(0, |point, bit| point ^ column(dimension, first_bit + bit))
            })
        };
        Self([0, 8].map(|first_bit| core::array::from_fn(|byte| row(first_bit, byte))))
    }
}
