//! Depth images: each encoding against a naive oracle, and every refusal.

use proptest::prelude::*;

use super::camera::info;
use super::*;
use crate::engine::Depths;
use crate::msg::ros::Image;

/// How a test writes its depths.
#[derive(Clone, Copy, Debug)]
struct Form {
    encoding: &'static str,
    padding: u32,
    is_bigendian: bool,
}

const PLAIN: Form = Form { encoding: "16UC1", padding: 0, is_bigendian: false };
const FORMS: [Form; 6] = [
    PLAIN,
    Form { encoding: "mono16", ..PLAIN },
    Form { padding: 7, ..PLAIN },
    Form { is_bigendian: true, padding: 1, ..PLAIN },
    Form { encoding: "32FC1", padding: 3, ..PLAIN },
    Form { encoding: "32FC1", is_bigendian: true, ..PLAIN },
];

impl Form {
    /// An image of these depths: millimetres, or in `32FC1` metres.
    fn image(&self, width: u32, depths: &[f32]) -> Image {
        let pixel = if self.encoding == "32FC1" { 4 } else { 2 };
        let step = width * pixel + self.padding;
        let mut data = Vec::new();
        for row in depths.chunks(width as usize) {
            for &depth in row {
                let mut bytes = match pixel {
                    4 => depth.to_le_bytes().to_vec(),
                    _ => (depth as u16).to_le_bytes().to_vec(),
                };
                if self.is_bigendian {
                    bytes.reverse();
                }
                data.extend(bytes);
            }
            // What lies beside the pixels must not matter.
            data.extend(vec![0xff; self.padding as usize]);
        }
        Image {
            header: header("anywhere"),
            height: depths.len() as u32 / width,
            width,
            encoding: self.encoding.to_owned(),
            is_bigendian: u8::from(self.is_bigendian),
            step,
            data,
        }
    }
}

fn camera(width: u32, height: u32) -> Camera {
    Camera::from_info(&info(width, height)).unwrap()
}

fn cdr_of(image: &Image) -> Vec<u8> {
    to_vec::<_, LittleEndian>(image).unwrap()
}

fn image_by_seed(cdr: &[u8], camera: Camera) -> cdr_encoding::Result<Decoded> {
    DepthSeed::new(camera, KINECT).deserialize(&mut CdrDeserializer::<LittleEndian>::new(cdr))
}

/// Decodes by both ways in and holds them equal.
fn image_taken(image: &Image, camera: Camera) -> Decoded {
    let owned = decode_depth(image, &camera, &KINECT);
    assert_eq!(image_by_seed(&cdr_of(image), camera).unwrap(), owned);
    owned
}

fn image_of(points: &Points) -> &Depths {
    let Points::Depths(depths) = points else { panic!("a depth image holds depths") };
    depths
}

fn list(points: &Points) -> Vec<[f32; 3]> {
    image_of(points).list()
}

/// What a depth stands for (m), for the range and for the point.
fn naive_depth(form: &Form, sent: f32) -> Option<(f64, f32)> {
    if form.encoding == "32FC1" {
        return (sent.is_finite() && sent > 0.0).then_some((f64::from(sent), sent));
    }
    let number = sent as u16;
    (number != 0 && number != 65535).then(|| (f64::from(number) / 1000.0, f32::from(number) * 0.001))
}

/// Points, invalid and out of range, from the definition of a pinhole camera.
fn naive(form: &Form, width: u32, sent: &[f32]) -> (Vec<[f32; 3]>, u32, u32) {
    let (mut points, mut invalid, mut out_of_range) = (Vec::new(), 0, 0);
    for (i, &depth) in sent.iter().enumerate() {
        let (u, v) = ((i % width as usize) as f32, (i / width as usize) as f32);
        match naive_depth(form, depth) {
            None => invalid += 1,
            Some((range, _)) if !(0.4..=6.0).contains(&range) => out_of_range += 1,
            Some((_, z)) => points.push([(u - 319.5) / 525.0 * z, (v - 239.5) / 520.0 * z, z]),
        }
    }
    (points, invalid, out_of_range)
}

#[test]
fn a_ray_ends_where_a_sensor_can_have_measured_and_no_farther() {
    let depths = [1.0, 100.0, 100.1];
    let image = Form { encoding: "32FC1", ..PLAIN }.image(3, &depths);
    let points = image_taken(&image, camera(3, 1)).unwrap().points;
    assert_eq!(image_of(&points).ends().iter().map(|end| end[2]).collect::<Vec<_>>(), [100.0]);
    let cloud = super::Form::xyz(16).message(OPTICAL_FRAME, 1, &depths.map(|z| [0.0, 0.0, f64::from(z)]));
    let points = taken(&cloud, &KINECT).unwrap().points;
    assert_eq!(points, Points::Ended { points: vec![[0.0, 0.0, 1.0]], ends: vec![[0.0, 0.0, 100.0]] });
}

#[test]
fn every_encoding_gives_the_same_points() {
    let millimetres = [0.0, 500.0, 65535.0, 1234.0, 399.0, 6001.0];
    for form in FORMS {
        let sent = match form.encoding {
            "32FC1" => [NAN as f32, 500.0 * 0.001, -1.0, 1234.0 * 0.001, 0.399, 6.001],
            _ => millimetres,
        };
        let cloud = image_taken(&form.image(3, &sent), camera(3, 2)).unwrap();
        let expected = naive(&PLAIN, 3, &millimetres).0;
        assert_eq!((expected.len(), list(&cloud.points)), (2, expected), "{form:?}");
        assert_eq!((cloud.total, cloud.invalid, cloud.out_of_range), (6, 2, 2), "{form:?}");
        assert_eq!((cloud.stamp, cloud.frame_id.as_str()), (Stamp::from_nanos(12_500_000_000), "anywhere"));
    }
}

#[test]
fn the_limits_are_inclusive_to_the_millimetre() {
    let cloud = image_taken(&PLAIN.image(4, &[399.0, 400.0, 6000.0, 6001.0]), camera(4, 1)).unwrap();
    assert_eq!((cloud.points.len(), cloud.out_of_range), (2, 2));
}

#[test]
fn what_is_too_far_away_is_where_a_ray_ends_and_what_is_too_near_is_not() {
    let cloud = image_taken(&PLAIN.image(5, &[399.0, 6000.0, 6001.0, 0.0, 65535.0]), camera(5, 1)).unwrap();
    let ends: Vec<_> = image_of(&cloud.points).ends().iter().map(|end| end[2]).collect();
    assert_eq!((list(&cloud.points).len(), ends), (1, vec![6001.0 * 0.001]));
}

#[test]
fn a_depth_that_no_sensor_measures_is_where_no_ray_ends() {
    let form = FORMS.into_iter().find(|form| form.encoding == "32FC1").unwrap();
    let cloud = image_taken(&form.image(3, &[1.0, 1e4, f32::MAX]), camera(3, 1)).unwrap();
    assert_eq!((image_of(&cloud.points).ends().len(), cloud.points.len(), cloud.out_of_range), (0, 1, 2));
}

#[test]
fn an_image_without_pixels_is_an_empty_scan() {
    let image = Image { header: header("f"), encoding: "16UC1".to_owned(), ..Image::default() };
    assert_eq!(image_taken(&image, camera(0, 0)).unwrap().total, 0);
    let flat = Image { width: 640, ..image };
    assert_eq!(image_taken(&flat, camera(640, 0)).unwrap().total, 0);
}

/// A good image of six pixels, changed.
fn image_refused(change: impl FnOnce(&mut Image)) -> CloudError {
    let mut image = Form { padding: 2, ..PLAIN }.image(3, &[1000.0; 6]);
    change(&mut image);
    image_taken(&image, camera(3, 2)).unwrap_err()
}

#[test]
fn images_that_contradict_themselves_or_the_camera_are_refused_with_the_numbers() {
    assert_eq!(image_refused(|i| i.header.frame_id.clear()), CloudError::EmptyFrameId);
    let nanosec = 2_000_000_000;
    assert_eq!(image_refused(|i| i.header.stamp.nanosec = nanosec), CloudError::BadStamp { nanosec });
    let size = CloudError::ImageSize { width: 3, height: 3, camera_width: 3, camera_height: 2 };
    assert_eq!(image_refused(|i| i.height = 3), size);
    assert!(size.to_string().contains("3x3") && size.to_string().contains("3x2"));
    assert_eq!(image_refused(|i| i.step = 5), CloudError::ShortStep { step: 5, needed: 6 });
    let as_floats = image_refused(|i| i.encoding = "32FC1".to_owned());
    assert_eq!(as_floats, CloudError::ShortStep { step: 8, needed: 12 });
    assert_eq!(image_refused(|i| i.data.truncate(15)), CloudError::ShortData { needed: 16, got: 15 });
    let needed = 2 * u64::from(u32::MAX);
    assert_eq!(image_refused(|i| i.step = u32::MAX), CloudError::ShortData { needed, got: 16 });
    for encoding in ["rgb8", "8UC1", "", "16uc1"] {
        let unknown = CloudError::UnknownEncoding { encoding: encoding.to_owned() };
        assert_eq!(image_refused(|i| i.encoding = encoding.to_owned()), unknown);
    }
    let long = image_refused(|i| i.encoding = format!("\n{}", "x".repeat(500)));
    assert!(long.to_string().len() < 120 && !long.to_string().contains('\n'), "{long}");
}

#[test]
fn more_pixels_than_allowed_are_refused_before_they_are_looked_for() {
    let image = Image { width: 4000, height: 4000, ..PLAIN.image(1, &[1.0]) };
    let refused = image_taken(&image, camera(4000, 4000));
    assert_eq!(refused, Err(CloudError::TooManyPoints { points: 16_000_000, max: 4_000_000 }));
}

#[test]
fn a_cut_image_is_an_error_of_the_deserializer_at_every_length() {
    let whole = cdr_of(&PLAIN.image(2, &[1000.0, 2000.0]));
    assert!(image_by_seed(&whole, camera(2, 1)).unwrap().is_ok());
    for length in 0..whole.len() {
        assert!(image_by_seed(&whole[..length], camera(2, 1)).is_err(), "{length} of {} bytes", whole.len());
    }
}

/// Depths at which a rule changes, in the unit of the encoding.
fn depths(form: Form) -> impl Strategy<Value = (u32, Vec<f32>)> {
    let special = match form.encoding {
        "32FC1" => vec![0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.4, 6.0, 1e-40, 1e30],
        _ => vec![0.0, 1.0, 65534.0, 65535.0, 399.0, 400.0, 6000.0, 6001.0],
    };
    let usual = if form.encoding == "32FC1" { -1.0..8.0_f32 } else { 0.0..8000.0_f32 };
    let depth = prop_oneof![3 => usual, 1 => prop::sample::select(special)];
    (1..7_u32, 1..5_u32).prop_flat_map(move |(width, height)| {
        (Just(width), prop::collection::vec(depth.clone(), (width * height) as usize))
    })
}

fn any_image() -> impl Strategy<Value = (Form, u32, Vec<f32>)> {
    prop::sample::select(FORMS.to_vec())
        .prop_flat_map(|form| depths(form).prop_map(move |(width, depths)| (form, width, depths)))
}

proptest! {
    #[test]
    fn any_image_equals_the_naive_oracle((form, width, sent) in any_image()) {
        let image = form.image(width, &sent);
        let cloud = image_taken(&image, camera(width, image.height)).unwrap();
        let (points, invalid, out_of_range) = naive(&form, width, &sent);
        prop_assert_eq!(list(&cloud.points), points);
        prop_assert_eq!((cloud.invalid, cloud.out_of_range), (invalid, out_of_range));
        prop_assert_eq!(cloud.total as usize, sent.len());
    }

    #[test]
    fn points_are_finite_whatever_the_camera(
        numbers in prop::array::uniform4(any::<f64>()), sent in prop::array::uniform4(any::<f32>()),
    ) {
        let mut wild = info(2, 2);
        [wild.p[0], wild.p[2], wild.p[5], wild.p[6]] = numbers;
        if let Ok(camera) = Camera::from_info(&wild) {
            let image = Form { encoding: "32FC1", ..PLAIN }.image(2, &sent);
            let cloud = decode_depth(&image, &camera, &CloudFilter { max_range: f64::MAX, ..KINECT }).unwrap();
            prop_assert!(wide(&cloud.points).iter().flatten().all(|value| value.is_finite()));
        }
    }

    #[test]
    fn random_bytes_never_panic_as_an_image(bytes in prop::collection::vec(any::<u8>(), 0..512)) {
        let _ = image_by_seed(&bytes, camera(3, 2));
    }

    #[test]
    fn a_damaged_image_never_panics_and_both_ways_in_agree(
        (form, width, sent) in any_image(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let image = form.image(width, &sent);
        let (camera, mut bytes) = (camera(width, image.height), cdr_of(&image));
        for (index, value) in damage {
            let at = index.index(bytes.len());
            bytes[at] = value;
        }
        let owned = cdr_encoding::from_bytes::<Image, LittleEndian>(&bytes);
        match (image_by_seed(&bytes, camera), owned.map(|(image, _)| decode_depth(&image, &camera, &KINECT))) {
            (Ok(seed), Ok(owned)) => prop_assert_eq!(seed, owned),
            (Err(_), Err(_)) => {}
            (seed, owned) => prop_assert!(false, "{seed:?} but {owned:?}"),
        }
    }
}
