//! Which particles are recorded and drawn.

/// At most `limit` of `count` particles, the same in every frame. One is taken from each of `limit`
/// equal runs of the sampling order, at a hashed place in its run, because a fixed stride would
/// show the sampling lattice as stripes.
pub fn select(count: usize, limit: usize, seed: u64) -> Vec<u32> {
    if count <= limit {
        return (0..count as u32).collect();
    }
    let start = |k: usize| (k as u128 * count as u128 / limit as u128) as usize;
    let pick = |k: usize| start(k) + (hash(seed ^ k as u64) as usize) % (start(k + 1) - start(k));
    (0..limit).map(|k| pick(k) as u32).collect()
}

/// The finaliser of splitmix64 (Steele et al. 2014).
pub fn hash(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// The ascending union of two ascending selections, and the positions of each selection's entries
/// in it.
pub fn union(a: &[u32], b: &[u32]) -> (Vec<u32>, [Vec<u32>; 2]) {
    let mut all: Vec<u32> = a.iter().chain(b).copied().collect();
    all.sort_unstable();
    all.dedup();
    all.shrink_to_fit();
    let within = [a, b].map(|part| {
        let mut at = 0;
        let place = |id: &u32| {
            at += all[at..].iter().take_while(|other| *other < id).count();
            at as u32
        };
        part.iter().map(place).collect()
    });
    (all, within)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridfall_core::sim::excerpt::{Choice, Excerpt};
    use gridfall_core::sim::particles::{IDENTITY, Particles};

    #[test]
    fn decimation_is_even_and_repeatable() {
        let chosen = select(1_000, 300, 7);
        assert_eq!(chosen, select(1_000, 300, 7));
        assert_ne!(chosen, select(1_000, 300, 8));
        assert_eq!(chosen.len(), 300);
        assert!(chosen.windows(2).all(|pair| pair[0] < pair[1] && pair[1] - pair[0] <= 7));
        assert_eq!(select(5, 300, 7), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn an_excerpt_of_two_selections_serves_both() {
        let (a, b) = (select(1_000, 40, 1), select(1_000, 25, 2));
        let (all, [in_a, in_b]) = union(&a, &b);
        let choice = Choice { ids: all.into(), deformation: false };
        let mut excerpt = Excerpt::of(&choice);
        // 700 of 1000 particles exist, in parts of unequal length.
        for range in [0..1, 1..250, 250..251, 251..700] {
            let n = range.len();
            let part = Particles {
                x: range.clone().map(|id| [id as f64, 0.0, 0.0]).collect(),
                v: vec![[0.0; 3]; n],
                b: vec![[0.0; 9]; n],
                f: vec![IDENTITY; n],
                plastic: vec![0.0; n],
                body: vec![0; n],
                touch: Vec::new(),
            };
            excerpt.take(&choice, range.start, &part);
        }
        for (selection, within) in [(a, in_a), (b, in_b)] {
            let present = excerpt.present(&within);
            assert_eq!(present, selection.iter().filter(|&&id| id < 700).count());
            for (&id, &k) in selection.iter().zip(&within[..present]) {
                assert_eq!(excerpt.x[k as usize][0], f64::from(id));
            }
        }
    }
}
