#include "camera/rectifier.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace twofold {
namespace {

/// Axis-parallel window on the plane z = 1 of the rectified camera.
struct Window {
  double x_min, x_max, y_min, y_max;
};

struct Windows {
  Window inner;  ///< every point has a source in every camera
  Window outer;  ///< contains every camera's image
};

Windows unbounded(double limit) {
  return {{-limit, limit, -limit, limit}, {limit, -limit, limit, -limit}};
}

/// Shrinks inner and grows outer by one camera's border, seen in the rectified camera.
void include_border(const CameraModel& camera, const SO3& R_rectified_raw, double limit, Windows& w) {
  constexpr int kSamples = 64;  // an edge
  const double u_max = camera.pinhole.width - 1;
  const double v_max = camera.pinhole.height - 1;
  // nullopt: not visible to a forward looking camera, where `limit` bounds the windows instead
  const auto seen_at = [&](double u, double v) -> std::optional<Vector2> {
    const auto ray = camera.unproject({u, v});
    if (!ray) return std::nullopt;
    const Vector3 x = R_rectified_raw * *ray;
    if (x.z() <= 0) return std::nullopt;
    return Vector2(x.head<2>() / x.z()).cwiseMax(-limit).cwiseMin(limit);
  };
  for (int i = 0; i <= kSamples; ++i) {
    const double s = static_cast<double>(i) / kSamples;
    if (const auto p = seen_at(0, s * v_max)) {
      w.inner.x_min = std::max(w.inner.x_min, p->x());
      w.outer.x_min = std::min(w.outer.x_min, p->x());
    }
    if (const auto p = seen_at(u_max, s * v_max)) {
      w.inner.x_max = std::min(w.inner.x_max, p->x());
      w.outer.x_max = std::max(w.outer.x_max, p->x());
    }
    if (const auto p = seen_at(s * u_max, 0)) {
      w.inner.y_min = std::max(w.inner.y_min, p->y());
      w.outer.y_min = std::min(w.outer.y_min, p->y());
    }
    if (const auto p = seen_at(s * u_max, v_max)) {
      w.inner.y_max = std::min(w.inner.y_max, p->y());
      w.outer.y_max = std::max(w.outer.y_max, p->y());
    }
  }
  // An edge that is out of sight altogether: the image goes on to the limit.
  w.outer.x_min = w.outer.x_min > w.outer.x_max ? -limit : w.outer.x_min;
  w.outer.x_max = w.outer.x_max <= w.outer.x_min ? limit : w.outer.x_max;
  w.outer.y_min = w.outer.y_min > w.outer.y_max ? -limit : w.outer.y_min;
  w.outer.y_max = w.outer.y_max <= w.outer.y_min ? limit : w.outer.y_max;
}

/// Pinhole with fx = fy whose width x height pixels lie in the inner window (field = 0), cover the outer one
/// (field = 1), or something between.
PinholeCamera fit_pinhole(const Windows& w, int width, int height, double field) {
  const auto centre = [field](double in_min, double in_max, double out_min, double out_max) {
    return 0.5 * ((1 - field) * (in_min + in_max) + field * (out_min + out_max));
  };
  const double f_inner = std::max((width - 1) / (w.inner.x_max - w.inner.x_min),  //
                                  (height - 1) / (w.inner.y_max - w.inner.y_min));
  const double f_outer =
      std::min((width - 1) / (w.outer.x_max - w.outer.x_min), (height - 1) / (w.outer.y_max - w.outer.y_min));
  PinholeCamera c;
  c.width = width;
  c.height = height;
  c.fx = c.fy = (1 - field) * f_inner + field * f_outer;
  c.cx = 0.5 * (width - 1) - c.fx * centre(w.inner.x_min, w.inner.x_max, w.outer.x_min, w.outer.x_max);
  c.cy = 0.5 * (height - 1) - c.fy * centre(w.inner.y_min, w.inner.y_max, w.outer.y_min, w.outer.y_max);
  return c;
}

/// Rows of R: x along the baseline, z as near as possible to both cameras' mean viewing direction.
SO3 stereo_rotation(const SE3& T_right_left) {
  const SE3 T_left_right = T_right_left.inverse();
  const Vector3 x = T_left_right.translation().normalized();
  const Vector3 mean_z = Vector3::UnitZ() + T_left_right.rotation().col(2);
  const Vector3 y = mean_z.cross(x).normalized();
  Matrix3 R;
  R << x.transpose(), y.transpose(), x.cross(y).transpose();
  return SO3(R);
}

RectificationMap make_map(const PinholeCamera& rectified, const SO3& R_rectified_raw,
                          const CameraModel& raw) {
  constexpr float kNoSource = -10000;  // far outside of any image: reads as border
  const Matrix3 R_raw_rectified = R_rectified_raw.inverse().matrix();
  RectificationMap map;
  map.x.create(rectified.height, rectified.width, CV_32FC1);
  map.y.create(rectified.height, rectified.width, CV_32FC1);
  for (int v = 0; v < rectified.height; ++v) {
    auto* row_x = map.x.ptr<float>(v);
    auto* row_y = map.y.ptr<float>(v);
    for (int u = 0; u < rectified.width; ++u) {
      const Vector3 ray = R_raw_rectified * rectified.unproject(Vector2(u, v));
      row_x[u] = row_y[u] = kNoSource;
      if (ray.z() <= 0) continue;
      Eigen::Matrix2d J;
      const Vector2 xy = ray.head<2>() / ray.z();
      const Vector2 xy_d = raw.distortion.distort(xy, &J);
      if (!(J.determinant() > 0) || !raw.distortion.reaches(xy))
        continue;  // beyond a fold or a pole: another copy of the image
      row_x[u] = static_cast<float>(raw.pinhole.fx * xy_d.x() + raw.pinhole.cx);
      row_y[u] = static_cast<float>(raw.pinhole.fy * xy_d.y() + raw.pinhole.cy);
    }
  }
  return map;
}

/// Of the rectified pixels: those without a source in the raw image.
double black_share_of(const RectificationMap& map, const PinholeCamera& raw) {
  std::int64_t black = 0;
  for (int v = 0; v < map.x.rows; ++v) {
    const auto* row_x = map.x.ptr<float>(v);
    const auto* row_y = map.y.ptr<float>(v);
    for (int u = 0; u < map.x.cols; ++u)
      if (!raw.contains(Vector2(row_x[u], row_y[u]), -1.0)) ++black;
  }
  return static_cast<double>(black) / static_cast<double>(map.x.total());
}

std::string size_text(int width, int height) {
  return std::to_string(width) + " x " + std::to_string(height);
}

std::string black_text(double share) {
  return "of the rectified image " + std::to_string(std::lround(100 * share)) + " % are black";
}

std::string image_reason(const cv::Mat& image, const char* name, int type, const char* type_name, int width,
                         int height) {
  if (image.empty()) return std::string("the ") + name + " image is missing";
  if (image.type() != type) return std::string("the ") + name + " image is not " + type_name;
  if (image.cols != width || image.rows != height) {
    return std::string("the ") + name + " image has " + size_text(image.cols, image.rows) +
           " pixels, the calibration says " + size_text(width, height);
  }
  return {};
}

}  // namespace

std::string RectifierOptions::invalid_reason() const {
  if (width < 0 || height < 0) return "rectified size must not be negative, is " + size_text(width, height);
  if ((width == 0) != (height == 0)) return "rectified width and height must be given together";
  if (!(field >= 0 && field <= 1)) return "field must be in [0, 1], is " + std::to_string(field);
  if (!(max_half_field_deg > 0 && max_half_field_deg <= 80)) {
    return "max_half_field_deg must be in (0, 80], is " + std::to_string(max_half_field_deg);
  }
  return {};
}

Rectifier::Rectifier(const Calibration& calibration, const RectifierOptions& options) {
  if (const auto reason = calibration.invalid_reason(); !reason.empty()) throw std::runtime_error(reason);
  if (const auto reason = options.invalid_reason(); !reason.empty()) throw std::runtime_error(reason);
  rig_.kind = calibration.kind;
  rig_.depth_unit = calibration.depth_unit;
  rig_.depth_min = calibration.depth_min;
  rig_.depth_max = calibration.depth_max;
  rig_.readout = calibration.readout;
  if (calibration.kind == SensorKind::kStereo) rig_.baseline = calibration.T_right_left.translation().norm();
  if (calibration.kind == SensorKind::kRgbd) rig_.baseline = calibration.virtual_baseline;
  raw_left_size_ = {calibration.left.pinhole.width, calibration.left.pinhole.height};
  raw_right_size_ = {calibration.right.pinhole.width, calibration.right.pinhole.height};

  raw_depth_size_ = raw_left_size_;
  find_maps(calibration, options);
  constexpr double kMostBlack = 0.5;
  if (options.field == 0 && black_share_ > kMostBlack)
    throw std::runtime_error(black_text(black_share_) +
                             ", for the lens does not reach that far from its axis: "
                             "are its coefficients complete, and in the model's order?");
  if (!calibration.depth_apart || calibration.kind != SensorKind::kRgbd) return;
  const PinholeCamera& depth = calibration.depth_camera.model.pinhole;
  raw_depth_size_ = {depth.width, depth.height};
  registration_.emplace(calibration.depth_camera, SE3(R_rectified_left_, Vector3::Zero()), rig_.camera,
                        rig_.depth_unit);
}

void Rectifier::find_maps(const Calibration& calibration, const RectifierOptions& options) {
  const bool stereo = calibration.kind == SensorKind::kStereo;
  const bool ideal = !stereo && calibration.left.distortion.is_identity() && options.width == 0;
  if (calibration.already_rectified || ideal) {
    rig_.camera = calibration.left.pinhole;
    return;
  }
  if (stereo) {
    R_rectified_left_ = stereo_rotation(calibration.T_right_left);
    R_rectified_right_ = R_rectified_left_ * calibration.T_right_left.so3().inverse();
  }
  const double limit = std::tan(options.max_half_field_deg * M_PI / 180);
  Windows windows = unbounded(limit);
  include_border(calibration.left, R_rectified_left_, limit, windows);
  if (stereo) include_border(calibration.right, R_rectified_right_, limit, windows);
  if (!(windows.inner.x_max > windows.inner.x_min && windows.inner.y_max > windows.inner.y_min)) {
    throw std::runtime_error("the cameras share no rectangular part of their views; check T_right_left");
  }
  rig_.camera = fit_pinhole(windows, options.width > 0 ? options.width : raw_left_size_.width,
                            options.height > 0 ? options.height : raw_left_size_.height, options.field);
  left_ = make_map(rig_.camera, R_rectified_left_, calibration.left);
  black_share_ = black_share_of(left_, calibration.left.pinhole);
  cv::convertMaps(left_.x, left_.y, left_fixed_.xy, left_fixed_.fraction, CV_16SC2);
  if (!stereo) return;
  right_ = make_map(rig_.camera, R_rectified_right_, calibration.right);
  black_share_ = std::max(black_share_, black_share_of(right_, calibration.right.pinhole));
  cv::convertMaps(right_.x, right_.y, right_fixed_.xy, right_fixed_.fraction, CV_16SC2);
}

std::string Rectifier::black_note() const {
  constexpr double kMuch = 0.2;
  return black_share_ < kMuch ? "" : black_text(black_share_);
}

void Rectifier::rectify(const Frame& raw, Frame& rectified) const {
  rectified.index = raw.index;
  rectified.t_ns = raw.t_ns;
  const auto remap = [this](const cv::Mat& source, cv::Mat& target, const FixedMap& map, bool bilinear) {
    if (source.empty()) {
      target.release();
    } else if (passes_through()) {
      target = source;
    } else if (bilinear) {
      cv::remap(source, target, map.xy, map.fraction, cv::INTER_LINEAR, cv::BORDER_CONSTANT, 0);
    } else {  // depths of two surfaces must not be averaged
      cv::remap(source, target, left_.x, left_.y, cv::INTER_NEAREST, cv::BORDER_CONSTANT, 0);
    }
  };
  remap(raw.left, rectified.left, left_fixed_, true);
  remap(raw.right, rectified.right, right_fixed_, true);
  if (registration_ && !raw.depth.empty()) {
    registration_->apply(raw.depth, rectified.depth);
  } else {
    remap(raw.depth, rectified.depth, left_fixed_, false);
  }
}

cv::Mat Rectifier::rectified_left(const cv::Mat& raw) const {
  if (passes_through()) return raw;
  cv::Mat rectified;
  cv::remap(raw, rectified, left_.x, left_.y, cv::INTER_LINEAR);
  return rectified;
}

std::string Rectifier::mismatch_reason(const Frame& raw) const {
  const auto [width, height] = raw_left_size_;
  if (auto reason = image_reason(raw.left, "left", CV_8UC1, "8-bit grey", width, height); !reason.empty()) {
    return reason;
  }
  if (rig_.kind == SensorKind::kStereo) {
    return image_reason(raw.right, "right", CV_8UC1, "8-bit grey", raw_right_size_.width,
                        raw_right_size_.height);
  }
  if (rig_.kind == SensorKind::kRgbd) {
    return image_reason(raw.depth, "depth", CV_16UC1, "16-bit", raw_depth_size_.width,
                        raw_depth_size_.height);
  }
  return {};
}

}  // namespace twofold
