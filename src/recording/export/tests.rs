//! Which points and arrays are exported.

use foxglove::messages::{PackedElementField, PointCloud};

use super::*;

/// Two points of 16 bytes: their position, and `fields` of a byte each.
fn cloud(fields: &[&str]) -> Cloud {
    let real = ["x", "y", "z"].iter().zip([0, 4, 8]).map(|(name, at)| (*name, at, NumericType::Float32));
    let bytes = fields.iter().zip(12..).map(|(name, at)| (*name, at, NumericType::Uint8));
    let field = |(name, offset, kind): (&str, u32, NumericType)| PackedElementField {
        name: name.into(),
        offset,
        r#type: kind.into(),
    };
    let data: Vec<u8> = (0..32).collect();
    let fields = real.chain(bytes).map(field).collect();
    let message = PointCloud { point_stride: 16, fields, data: data.into(), ..PointCloud::default() };
    Cloud::new(message, 0.0).unwrap()
}

fn arrays(fields: &[&str]) -> Vec<(String, Shape)> {
    let cloud = cloud(fields);
    let frame = Frame { points: vec![0, 1], cloud: &cloud, bodies: &[] };
    frame.arrays().into_iter().map(|array| (array.name, array.shape)).collect()
}

#[test]
fn components_are_joined_where_all_are_there() {
    let scalar = |name: &str| (name.to_owned(), Shape::Scalar);
    assert_eq!(arrays(&["vx", "J", "vy", "vz"]), [("velocity".into(), Shape::Vector(3)), scalar("J")]);
    assert_eq!(arrays(&["vx", "vy", "a b/c", "e_xx"]), ["vx", "vy", "a_b_c", "e_xx"].map(scalar));
    let (name, shape, members) = group("stress_yz").unwrap();
    assert_eq!((name.as_str(), shape, members[7].as_str()), ("stress", Shape::Tensor, "stress_yz"));
}

#[test]
fn selections_are_of_bodies_that_are_there() {
    let names: Vec<String> = ["cube", "pool"].map(String::from).into();
    let of = |wanted: &[&str], most: usize| {
        let wanted: Vec<String> = wanted.iter().map(|name| (*name).into()).collect();
        Selection::new(names.clone(), &wanted, most)
    };
    // The byte of the field is 12 in the first point and 28 in the second.
    assert_eq!(of(&[], 9).unwrap().points(&cloud(&["body"])).unwrap(), [0, 1]);
    assert_eq!(of(&[], 1).unwrap().points(&cloud(&["body"])).unwrap(), [0]);
    assert!(of(&["pool"], 9).unwrap().points(&cloud(&["body"])).unwrap().is_empty());
    let error = of(&["pool"], 9).unwrap().points(&cloud(&["J"])).unwrap_err();
    assert!(error.to_string().contains("output.fields"), "{error}");
    let error = of(&["pond"], 9).unwrap_err();
    assert_eq!(error.to_string(), "there is no body or source \"pond\"; there are cube, pool");
    assert_eq!(of(&["pool", "cube", "pool"], 9).unwrap().bodies(), [0, 1]);
    let many = Selection { names: vec![], bodies: Some(vec![28]), most: 9 };
    assert_eq!(many.points(&cloud(&["body"])).unwrap(), [1]);
}
