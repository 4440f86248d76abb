//! Which topics of a bag are its sensors.

use super::*;

fn topics(list: &[(&str, &str)]) -> Vec<Topic> {
    let topic = |&(name, kind): &(&str, &str)| Topic {
        name: name.to_owned(),
        type_name: format!("sensor_msgs/msg/{kind}"),
        encoding: "cdr".to_owned(),
        messages: Some(3),
    };
    list.iter().map(topic).collect()
}

fn kinect() -> Vec<Topic> {
    topics(&[
        ("/camera/depth/points", "PointCloud2"),
        ("/camera/depth/image_raw", "Image"),
        ("/camera/rgb/image_color", "Image"),
        ("/camera/depth/camera_info", "CameraInfo"),
        ("/camera/rgb/camera_info", "CameraInfo"),
        ("/cfodi/points_labelled", "PointCloud2"),
    ])
}

fn wanted(topic: &str) -> Wanted {
    Wanted { topic: topic.to_owned(), info: None }
}

fn names(choice: &Choice) -> Vec<&str> {
    choice.sensors.iter().map(|sensor| sensor.topic.as_str()).collect()
}

#[test]
fn the_only_cloud_is_taken_and_what_was_passed_over_is_known() {
    let choice = choose(&kinect(), &[], &[], None).unwrap();
    assert_eq!(names(&choice), ["/camera/depth/points"]);
    assert_eq!(choice.passed_over, ["/camera/depth/image_raw"]);
}

#[test]
fn a_topic_without_a_message_is_no_sensor() {
    let mut topics = kinect();
    topics[0].messages = Some(0);
    assert_eq!(names(&choose(&topics, &[], &[], None).unwrap()), ["/camera/depth/image_raw"]);
}

#[test]
fn the_first_usual_name_that_has_scans_is_taken_and_the_others_are_known() {
    let usual = ["/points", "/depth/image"].map(str::to_owned);
    let mut topics = topics(&[
        ("/camera/depth/points", "PointCloud2"),
        ("/points", "PointCloud2"),
        ("/depth/image", "Image"),
        ("/depth/camera_info", "CameraInfo"),
    ]);
    let chosen = |topics: &[Topic]| {
        let choice = choose(topics, &[], &usual, None).unwrap();
        (choice.sensors[0].topic.clone(), choice.passed_over)
    };
    let (points, image, camera) = ("/points", "/depth/image", "/camera/depth/points");
    assert_eq!(chosen(&topics), (points.to_owned(), [camera, image].map(str::to_owned).to_vec()));
    let none = Topic { messages: Some(0), ..topics[1].clone() };
    let other = Topic { type_name: "sensor_msgs/msg/LaserScan".to_owned(), ..topics[1].clone() };
    for of_no_use in [none, other] {
        topics[1] = of_no_use;
        assert_eq!(chosen(&topics), (image.to_owned(), vec![camera.to_owned()]));
    }
    topics[2].messages = Some(0);
    assert_eq!(chosen(&topics), (camera.to_owned(), Vec::new()));
}

#[test]
fn a_usual_name_is_known_without_its_slash() {
    let topics = topics(&[("camera/points", "PointCloud2"), ("points", "PointCloud2")]);
    let choice = choose(&topics, &[], &["/points".to_owned()], None).unwrap();
    assert_eq!(
        (names(&choice), choice.passed_over.as_slice()),
        (vec!["points"], &["camera/points".to_owned()][..])
    );
}

#[test]
fn without_a_cloud_the_depth_image_is_taken_with_its_own_intrinsics() {
    let choice = choose(&kinect()[1..5], &[], &[], None).unwrap();
    assert_eq!(names(&choice), ["/camera/depth/image_raw"]);
    assert_eq!(choice.sensors[0].info_topic.as_deref(), Some("/camera/depth/camera_info"));
}

#[test]
fn a_compressed_image_finds_the_intrinsics_of_the_plain_one() {
    let topics = topics(&[
        ("/camera/depth/image_raw/compressedDepth", "CompressedImage"),
        ("/camera/depth/camera_info", "CameraInfo"),
        ("/camera/rgb/camera_info", "CameraInfo"),
    ]);
    let choice = choose(&topics, &[], &[], None).unwrap();
    assert_eq!(choice.sensors[0].info_topic.as_deref(), Some("/camera/depth/camera_info"));
}

#[test]
fn several_sensors_can_be_named_and_a_slash_is_not_needed() {
    let wanted = ["camera/depth/points", "/camera/rgb/image_color"].map(wanted);
    assert_eq!(
        names(&choose(&kinect(), &wanted, &[], None).unwrap()),
        wanted.map(|wanted| format!("/{}", wanted.topic.trim_start_matches('/')))
    );
}

#[test]
fn each_image_has_the_intrinsics_that_are_wanted_for_it_then_its_own_whatever_there_is_for_others() {
    let topics = topics(&[
        ("/front/image", "Image"),
        ("/front/camera_info", "CameraInfo"),
        ("/rear/image", "Image"),
        ("/rear/camera_info", "CameraInfo"),
        ("/depth/camera_info", "CameraInfo"),
    ]);
    let infos = |wanted: &[Wanted], info: Option<&str>| -> Vec<_> {
        let info =
            info.map(|topic| Info { topic: topic.to_owned(), plain: Info::PLAIN.to_owned(), is_named: true });
        let sensors = choose(&topics, wanted, &[], info.as_ref()).unwrap().sensors.into_iter();
        sensors.map(|sensor| sensor.info_topic.unwrap()).collect()
    };
    let both = ["/front/image", "/rear/image"].map(wanted);
    assert_eq!(infos(&both, None), ["/front/camera_info", "/rear/camera_info"]);
    assert_eq!(infos(&both, Some("/depth/camera_info")), ["/depth/camera_info"; 2]);
    // One that nobody has fed is none, wherever it lies.
    let mut one = topics[2..].to_vec();
    one[1].messages = Some(0);
    let sensors = choose(&one, &[wanted("/rear/image")], &[], None).unwrap().sensors;
    assert_eq!(sensors[0].info_topic.as_deref(), Some("/depth/camera_info"));
    let info =
        Some(Info { topic: "/depth/camera_info".to_owned(), plain: Info::PLAIN.to_owned(), is_named: false });
    let rear = Wanted { info, ..wanted("/rear/image") };
    assert_eq!(infos(&[wanted("/front/image"), rear], None), ["/front/camera_info", "/depth/camera_info"]);
}

#[test]
fn intrinsics_that_somebody_has_named_are_never_replaced_by_those_of_another_camera() {
    let topics = kinect();
    let image = |name: &str, is_named| {
        let info = Some(Info { topic: name.to_owned(), plain: "rear/camera_info".to_owned(), is_named });
        [Wanted { info, ..wanted("/camera/depth/image_raw") }]
    };
    let found = |name: &str, is_named| {
        choose(&topics, &image(name, is_named), &[], None).map(|choice| choice.sensors[0].info_topic.clone())
    };
    for name in ["/camera/rgb/camera_info", "camera/rgb/camera_info"] {
        assert_eq!(found(name, true).unwrap().as_deref(), Some("/camera/rgb/camera_info"));
    }
    let missing = "/camera/depth/camera_inf";
    assert_eq!(found(missing, false).unwrap().as_deref(), Some("/camera/depth/camera_info"));
    let error = found(missing, true).unwrap_err();
    assert!(error.is_for_lack());
    let said = format!(
        "/camera/depth/image_raw need a sensor_msgs/msg/CameraInfo on {missing}, where -r has it read (is \
         /camera/depth/camera_info meant?); the bag holds:"
    );
    assert!(error.to_string().contains(&said), "{error}");
    // What is there under that name and is something else does not help.
    assert!(found("/camera/depth/points", true).is_err());
}

#[test]
fn several_clouds_are_asked_about_and_the_list_is_shown() {
    let topics = topics(&[("/left", "PointCloud2"), ("/right", "PointCloud2")]);
    let text = choose(&topics, &[], &[], None).unwrap_err().to_string();
    assert!(text.contains("--topic /left or --topic /right"), "{text}");
    assert!(text.contains("\n  /right 3 x sensor_msgs/msg/PointCloud2"), "{text}");
}

#[test]
fn what_does_not_fit_is_said_with_what_is_there() {
    let text = |name: &str| choose(&kinect(), &[wanted(name)], &[], None).unwrap_err().to_string();
    assert!(text("/camera/depth/point").contains("is /camera/depth/points meant?"));
    let one = topics(&[("/camera/depth/points", "PointCloud2")]);
    let error = choose(&one, &[wanted("/points")], &[], None).unwrap_err().to_string();
    assert!(error.contains("no topic /points (is /camera/depth/points meant?)"), "{error}");
    assert!(text("/camera/depth/camera_info").contains("carries sensor_msgs/msg/CameraInfo"));
    let image = topics(&[("/oak/stereo/image_raw", "Image"), ("/oak/stereo/camera_info", "CameraInfo")]);
    let error = choose(&image, &[], &[], None).unwrap_err().to_string();
    assert!(error.contains("another name is taken with --topic /oak/stereo/image_raw; it holds:"), "{error}");
    let mut ros_1 = topics(&[("/camera/depth/points", "PointCloud2")]);
    for type_name in ["sensor_msgs/PointCloud2", "sensor_msgs/msg/PointCloud2"] {
        (ros_1[0].encoding, ros_1[0].type_name) = ("ros1".to_owned(), type_name.to_owned());
        for wanted in [&[][..], &[wanted("/camera/depth/points")]] {
            let error = choose(&ros_1, wanted, &[], None).unwrap_err().to_string();
            let said = "serialised as in ROS 1; convert the .bag that it was made of: rosbags-convert";
            assert!(error.contains(said), "{error}");
        }
    }
    let mut other = topics(&[("/camera/depth/points", "PointCloud2")]);
    other[0].encoding = "json".to_owned();
    let error = choose(&other, &[], &[], None).unwrap_err().to_string();
    assert!(error.contains("in CDR: the messages on /camera/depth/points are in \"json\""), "{error}");
    let nothing = ChoiceError::Nothing { hint: String::new(), held: " nothing".to_owned() };
    assert_eq!(choose(&[], &[], &[], None).unwrap_err(), nothing);
    let bare = topics(&[("/depth", "Image")]);
    let text = choose(&bare, &[], &[], None).unwrap_err().to_string();
    assert!(text.contains("on /camera_info") && text.contains("(0 in the bag)"), "{text}");
}
