//! Colours of values.

use super::*;

#[test]
fn values_have_colours() {
    let bounds = Bounds { low: -1.0, high: 3.0 };
    assert_eq!(color(&bounds, -1.0), color(&bounds, -7.0));
    assert_eq!(color(&bounds, f64::NAN), UNKNOWN);
    let light = |value| color(&bounds, value).iter().map(|c| u32::from(*c)).sum::<u32>();
    assert!(light(0.0) < light(1.0) && light(1.0) < light(2.0), "viridis grows lighter");
}

#[test]
fn one_value_has_a_range() {
    let Bounds { low, high } = Bounds { low: 2.0, high: 2.0 }.widened();
    assert!(low < 2.0 && high > 2.0);
}
