//! From a `sensor_msgs/CameraInfo` to intrinsics that are known to project.

use super::CloudError;
use crate::engine::Rays;
use crate::msg::ros::CameraInfo;
use crate::msg::types::COMPRESSED_DEPTH;

/// A pinhole camera: focal lengths, principal point and size of the images it sends (px).
///
/// Images are taken as rectified, as `depth_image_proc` takes them; [`Camera::is_distorted`] tells where they may not
/// be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Finite and above 0, as `fy` is.
    fx: f32,
    fy: f32,
    /// Finite, as `cy` is.
    cx: f32,
    cy: f32,
    width: u32,
    height: u32,
    distorted: bool,
}

impl Camera {
    /// The camera of the images that come with `info`.
    ///
    /// Intrinsics are those of P, and of K where P is not set (`P[0]` is 0), less the offset of the region of interest,
    /// over the binning, in this order, as `image_geometry` reads them.
    ///
    /// # Errors
    ///
    /// [`CloudError::BadIntrinsics`] where a focal length is not above 0, or a number or the direction of a pixel is not
    /// finite.
    pub fn from_info(info: &CameraInfo) -> Result<Self, CloudError> {
        let (k, p, roi) = (&info.k, &info.p, &info.roi);
        let [fx, fy, cx, cy] = if p[0] == 0.0 { [k[0], k[4], k[2], k[5]] } else { [p[0], p[5], p[2], p[6]] };
        let (bin_x, bin_y) = (info.binning_x.max(1), info.binning_y.max(1));
        let [fx, cx] = [fx, cx - f64::from(roi.x_offset)].map(|pixels| pixels / f64::from(bin_x));
        let [fy, cy] = [fy, cy - f64::from(roi.y_offset)].map(|pixels| pixels / f64::from(bin_y));
        let whole = roi.width == 0 && roi.height == 0;
        let (width, height) = if whole { (info.width, info.height) } else { (roi.width, roi.height) };
        let camera = Self {
            fx: fx as f32,
            fy: fy as f32,
            cx: cx as f32,
            cy: cy as f32,
            width: width / bin_x,
            height: height / bin_y,
            distorted: info.d.iter().any(|&coefficient| coefficient != 0.0),
        };
        if camera.projects() { Ok(camera) } else { Err(CloudError::BadIntrinsics { fx, fy, cx, cy }) }
    }

    /// Asked of the single-precision numbers that are used: 1e-60 is above 0, and 0 as `f32`.
    fn projects(&self) -> bool {
        let lengths = [self.fx, self.fy].iter().all(|length| length.is_finite() && *length > 0.0);
        lengths && self.cx.is_finite() && self.cy.is_finite() && self.widest().is_finite()
    }

    /// Pixels in a row.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Whether a lens distortion is given. It is not undone: an image that was not rectified is off by it.
    pub fn is_distorted(&self) -> bool {
        self.distorted
    }

    /// Refuses an image of another size.
    pub(super) fn check_size(&self, width: u32, height: u32) -> Result<(), CloudError> {
        let (camera_width, camera_height) = (self.width, self.height);
        if (width, height) == (camera_width, camera_height) {
            Ok(())
        } else {
            Err(CloudError::ImageSize { width, height, camera_width, camera_height })
        }
    }

    /// Where pixel (u, v) looks: x / z and y / z.
    pub(super) fn ray(&self, u: f32, v: f32) -> [f32; 2] {
        [(u - self.cx) / self.fx, (v - self.cy) / self.fy]
    }

    /// Where all its pixels look.
    pub(super) fn rays(&self) -> Rays {
        Rays {
            x: (0..self.width).map(|u| self.ray(u as f32, 0.0)[0]).collect(),
            y: (0..self.height).map(|v| self.ray(0.0, v as f32)[1]).collect(),
        }
    }

    /// The greatest x / z or y / z of its pixels, or 1.
    pub(super) fn widest(&self) -> f32 {
        let corners = [self.ray(0.0, 0.0), self.ray(self.width as f32, self.height as f32)];
        corners.iter().flatten().fold(1.0, |widest, ray| ray.abs().max(widest))
    }
}

/// What is to be said of distortion that the intrinsics on this topic tell of: it is not undone in the images on the other.
pub fn distortion(info: &str, image: &str) -> String {
    format!(
        "{info} tells of lens distortion: images of {image} are taken as rectified, and are off by it where they are not"
    )
}

/// What is to be said of images in another frame than their intrinsics, which are then another camera's: of the topics of both, and of
/// their frames. An empty frame of the intrinsics says nothing.
pub fn other_frame([image, info]: [&str; 2], [of_image, of_info]: [&str; 2]) -> Option<String> {
    (!of_info.is_empty() && of_info != of_image).then(|| {
        format!(
            "images of {image} are in frame `{of_image}`, their intrinsics on {info} in `{of_info}`: those of another camera make a \
             wrong map (choose with -r ...camera_info:=TOPIC)"
        )
    })
}

/// Whether an image is rectified, by its topic's name: `image_rect`, or `image_rect_raw`, compressed or not. The coefficients of
/// distortion beside it are those of the image that it was made from.
pub fn is_rectified_by_name(topic: &str) -> bool {
    let image = topic.strip_suffix(COMPRESSED_DEPTH).unwrap_or(topic);
    image.rsplit('/').next().is_some_and(|name| name.contains("rect"))
}
