//! What the log says of a node on a middleware made of channels.

use super::*;
use crate::cloud::Camera;
use crate::msg::ros::CameraInfo;

/// Two sensors of all forms.
pub(super) fn two() -> Fake {
    let mut fake = Fake::default();
    let mut rear = fake.inputs[0].clone();
    rear.name = "rear".to_owned();
    rear.points.as_mut().unwrap().resolved = "/rear".to_owned();
    let depth = rear.depth.as_mut().unwrap();
    depth.image.resolved = "/rear/image".to_owned();
    depth.camera_info.resolved = "/rear/camera_info".to_owned();
    fake.inputs.push(rear);
    fake
}

fn distorted_camera() -> Camera {
    let k = [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0];
    let info = CameraInfo { width: 640, height: 480, d: vec![0.1], k, ..CameraInfo::default() };
    Camera::from_info(&info).unwrap()
}

#[test]
fn what_is_wrong_with_one_sensor_does_not_hide_it_of_another() {
    let later = new_session(0) as f64 / 1e9 + 60.0;
    let hardly_used = || match cloud(at(later), "camera") {
        Event::Cloud(_, Ok(cloud)) => Cloud { total: 1000, invalid: 980, ..cloud },
        other => panic!("{other:?}"),
    };
    let events = (0..2).flat_map(|sensor| {
        [
            Event::Camera(sensor, Ok(distorted_camera())),
            Event::Cloud(Form::Points.of(sensor), Err(CloudError::EmptyFrameId)),
            Event::Cloud(Form::Points.of(sensor), Ok(hardly_used())),
            Event::Cloud(Form::Depth.of(sensor), Ok(hardly_used())),
        ]
    });
    let (_, said) = heard(|| reported(two(), events.collect()));
    for [name, points, image, info] in [
        ["points", "/points", "/depth/image", "/depth/camera_info"],
        ["rear", "/rear", "/rear/image", "/rear/camera_info"],
    ] {
        for begin in [
            format!("{info} tells of lens distortion"),
            format!("a cloud of {points} was skipped: header frame_id is empty"),
            format!("{points}: of 1000 points only 20 are used"),
            format!("{image} is skipped, for {points} was first"),
            format!("the stamps of the sensor {name} are "),
        ] {
            let lines = said.iter().filter(|(level, line)| *level == 30 && line.starts_with(&begin));
            assert_eq!(lines.count(), 1, "{begin}: {said:?}");
        }
    }
}
