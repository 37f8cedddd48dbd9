//! Mutations of bytes and of text. JSON is mostly mutated by its structure.

use rand::Rng;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;

use super::json;

/// Longest input (bytes).
const MOST_BYTES: usize = 1 << 16;

/// Numbers as people and programs write them at their worst.
pub const NUMBERS: &[&str] = &[
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "3",
    "1e-320",
    "1e-300",
    "1e-9",
    "0.5",
    "1e9",
    "1e12",
    "1e100",
    "1e308",
    "-1e308",
    "1e999",
    "127",
    "128",
    "255",
    "256",
    "65535",
    "65536",
    "2147483647",
    "-2147483648",
    "2147483648",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551615",
    "18446744073709551616",
    "NaN",
    "nan",
    "inf",
    "-Infinity",
    "0x10",
    "1_000",
    "1e",
    "",
];

const INTEGERS: &[u64] = &[
    0,
    1,
    2,
    3,
    7,
    8,
    63,
    64,
    127,
    128,
    255,
    256,
    0x7fff,
    0xffff,
    0x1_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
    u64::MAX - 8,
    1 << 40,
];

const FLOATS: &[f64] = &[
    0.0,
    -0.0,
    1.0,
    -1.0,
    1e-30,
    1e-308,
    5e-324,
    1e9,
    1e30,
    1e300,
    f64::MAX,
    f64::MIN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
];

/// A member of the pool after one or more mutations.
pub fn mutated(pool: &[Vec<u8>], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut input = pick(pool, rng).clone();
    if rng.random_bool(0.75)
        && let Ok(mut value) = serde_json::from_slice(&input)
    {
        let other = serde_json::from_slice(pick(pool, rng)).unwrap_or(serde_json::Value::Null);
        (0..rounds(rng)).for_each(|_| json::mutate(&mut value, &other, rng));
        input = value.to_string().into_bytes();
        if rng.random_bool(0.8) {
            input.truncate(16 * MOST_BYTES);
            return input;
        }
    }
    for _ in 0..rounds(rng) {
        mutate(&mut input, pool, rng);
    }
    input.truncate(MOST_BYTES);
    input
}

fn pick<'a>(pool: &'a [Vec<u8>], rng: &mut ChaCha8Rng) -> &'a Vec<u8> {
    pool.choose(rng).expect("a corpus has members")
}

fn rounds(rng: &mut ChaCha8Rng) -> u32 {
    *[1, 1, 1, 1, 2, 2, 3, 5, 8].choose(rng).unwrap()
}

fn mutate(input: &mut Vec<u8>, pool: &[Vec<u8>], rng: &mut ChaCha8Rng) {
    if input.is_empty() {
        input.extend((0..rng.random_range(1..16)).map(|_| rng.random::<u8>()));
        return;
    }
    match rng.random_range(0..10) {
        0 => {
            let at = rng.random_range(0..input.len());
            input[at] ^= 1 << rng.random_range(0..8);
        }
        1 => {
            let at = rng.random_range(0..input.len());
            input[at] = *[0, 1, 9, 10, 32, 45, 127, 128, 255].choose(rng).unwrap();
        }
        2 | 3 => overwrite(input, rng),
        4 => {
            let part = chunk(input, rng);
            drop(input.drain(part));
        }
        5 => {
            // Seldom so often that only a limit ends it.
            let part = input[chunk(input, rng)].to_vec();
            let times = *[1, 1, 2, 3, 10, 100, 1000].choose(rng).unwrap();
            let at = rng.random_range(0..=input.len());
            let times = times.min(1 + MOST_BYTES / part.len().max(1));
            drop(input.splice(at..at, part.repeat(times)));
        }
        6 => {
            let other = pick(pool, rng);
            if !other.is_empty() {
                let part = other[chunk(other, rng)].to_vec();
                let place = if rng.random() { chunk(input, rng) } else { input.len()..input.len() };
                drop(input.splice(place, part));
            }
        }
        7 => input.truncate(rng.random_range(0..input.len())),
        _ => number(input, rng),
    }
}

/// Some bytes of an input; few, mostly.
fn chunk(input: &[u8], rng: &mut ChaCha8Rng) -> std::ops::Range<usize> {
    let most = if rng.random_bool(0.8) { 32 } else { input.len() };
    let start = rng.random_range(0..input.len());
    start..(start + rng.random_range(1..=most.max(1))).min(input.len())
}

/// Puts an extreme value of some width over what is there.
fn overwrite(input: &mut [u8], rng: &mut ChaCha8Rng) {
    let (integer, float) = (*INTEGERS.choose(rng).unwrap(), *FLOATS.choose(rng).unwrap());
    let near = integer.wrapping_add_signed(rng.random_range(-2..=2));
    let bytes: Vec<u8> = match rng.random_range(0..6) {
        0 => (near as u16).to_le_bytes().into(),
        1 => (near as u32).to_le_bytes().into(),
        2 => near.to_le_bytes().into(),
        3 => (near as u32).to_be_bytes().into(),
        4 => (float as f32).to_le_bytes().into(),
        _ => float.to_le_bytes().into(),
    };
    let at = rng.random_range(0..input.len());
    let n = bytes.len().min(input.len() - at);
    input[at..at + n].copy_from_slice(&bytes[..n]);
}

/// Writes another number over one in decimal digits; anywhere, if there is none.
fn number(input: &mut Vec<u8>, rng: &mut ChaCha8Rng) {
    let from = rng.random_range(0..input.len());
    let digit = |c: &u8| c.is_ascii_digit();
    let start = input[from..].iter().position(digit).map_or(from, |n| from + n);
    let of_number = |c: &u8| c.is_ascii_digit() || matches!(c, b'.' | b'e' | b'-' | b'+');
    let length = input[start..].iter().position(|c| !of_number(c)).unwrap_or(input.len() - start);
    drop(input.splice(start..start + length, NUMBERS.choose(rng).unwrap().bytes()));
}
