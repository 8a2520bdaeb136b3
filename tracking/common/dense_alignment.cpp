#include "tracking/common/dense_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/core.hpp>

#include "base/option_check.hpp"
#include "geometry/symmetric_solve.hpp"
#include "imaging/level_pixels.hpp"
#include "imaging/pixel_row.hpp"

namespace twofold {
namespace {

constexpr float kMidGrey = 128;  // subtracted everywhere, so that gain and offset are hardly correlated

/// Weights of the four pixels around a sub-pixel position, the same for a whole window.
struct Bilinear {
  const std::uint8_t* p;  // top-left pixel of the window
  std::ptrdiff_t stride;
  float w00, w01, w10, w11;
};

/// Window of `size` pixels whose pixel `before` is at uv; false when it leaves the image.
bool window_at(const cv::Mat& image, float u, float v, int before, int size, Bilinear& window) {
  const float fu = std::floor(u);
  const float fv = std::floor(v);
  const int u0 = static_cast<int>(fu) - before;
  const int v0 = static_cast<int>(fv) - before;
  if (u0 < 0 || v0 < 0 || u0 + size >= image.cols || v0 + size >= image.rows) return false;
  const float a = u - fu;
  const float b = v - fv;
  const auto stride = static_cast<std::ptrdiff_t>(image.step);
  window = {image.data + v0 * stride + u0, stride, (1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b};
  return true;
}

/// Four pixels of a row and four of the next one.
Floats8 load_4x2(const std::uint8_t* p, std::ptrdiff_t stride) {
  std::uint8_t bytes[8];
  std::memcpy(bytes, p, 4);
  std::memcpy(bytes + 4, p + stride, 4);
  Bytes8 packed;
  std::memcpy(&packed, bytes, 8);
  return to_floats(packed);
}

/// Two rows of four samples of a window, from row `r` on.
Floats8 sample_4x2(const Bilinear& w, int r) {
  const std::uint8_t* p = w.p + r * w.stride;
  return w.w00 * load_4x2(p, w.stride) + w.w01 * load_4x2(p + 1, w.stride) +
         w.w10 * load_4x2(p + w.stride, w.stride) + w.w11 * load_4x2(p + w.stride + 1, w.stride) - kMidGrey;
}

/// Seven pixels of a row, as bytes of a number; the first is the lowest. (Written for little-endian
/// machines.)
std::uint64_t load_seven(const std::uint8_t* p) {
  std::uint32_t first_four = 0, last_four = 0;
  std::memcpy(&first_four, p, 4);
  std::memcpy(&last_four, p + 3, 4);
  return first_four | std::uint64_t{last_four >> 8} << 32;
}

Floats8 bytes_as_floats(std::uint64_t bytes) {
  Bytes8 packed;
  std::memcpy(&packed, &bytes, sizeof packed);
  return to_floats(packed);
}

/// The 6x6 samples of a window, in rows of eight whose last two are worth nothing. The same operations in the
/// same order as in sample_4x2.
void sample_6x6(const Bilinear& w, Floats8 (&rows)[6]) {
  std::uint64_t bytes = load_seven(w.p);
  Floats8 here = bytes_as_floats(bytes), next = bytes_as_floats(bytes >> 8);
  for (int r = 0; r < 6; ++r) {
    bytes = load_seven(w.p + (r + 1) * w.stride);
    const Floats8 below = bytes_as_floats(bytes), below_next = bytes_as_floats(bytes >> 8);
    rows[r] = w.w00 * here + w.w01 * next + w.w10 * below + w.w11 * below_next - kMidGrey;
    here = below;
    next = below_next;
  }
}

/// Four numbers of a row, from a column on, and four of the next.
template <int kColumn>
Floats8 four_of_each(const Floats8& row, const Floats8& next) {
  return __builtin_shufflevector(row, next, kColumn, kColumn + 1, kColumn + 2, kColumn + 3, kColumn + 8,
                                 kColumn + 9, kColumn + 10, kColumn + 11);
}

/// Eight residuals' weights in an iteratively reweighted Huber cost.
Floats8 huber_weights(const Floats8& residuals, float threshold) {
  const Floats8 size = residuals < 0 ? -residuals : residuals;
  return threshold / (size > threshold ? size : threshold + Floats8{});
}

/// What the later image is brighter by, when that is too much to be left to the solver; else 1.
float brightness_ratio(const cv::Mat& earlier, const cv::Mat& later, double much) {
  const double ratio = std::max(cv::mean(later)[0], 1.0) / std::max(cv::mean(earlier)[0], 1.0);
  return ratio > much || ratio < 1 / much ? static_cast<float>(ratio) : 1.0F;
}

}  // namespace

std::string DenseAlignmentOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("finest_level", finest_level, 0)
      .within("coarsest_level", coarsest_level, finest_level, ImagePyramid::kLevels - 1)
      .at_least("max_iterations", max_iterations, 1)
      .above("huber_grey", huber_grey, 0)
      .at_least("settled_px", settled_px, 0)
      .above("max_rms", max_rms, 0)
      .share("doubted_rms_share", doubted_rms_share)
      .above("light_change", light_change, 1)
      .reason();
}

DenseAlignment::DenseAlignment(std::size_t capacity, const DenseAlignmentOptions& options)
    : options_(options), samples_(capacity), usable_(capacity) {}

void DenseAlignment::prepare_directions(const PinholeCamera& level_camera,
                                        std::span<const AlignmentPoint> points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector3& x = points[i].x;
    samples_[i].du.setZero();
    samples_[i].dv.setZero();
    if (!in_front_of_camera(x)) continue;
    // d pixel / d (v, omega) for x -> exp(delta) x
    const Eigen::Matrix<float, 2, 3> J_x = level_camera.project_jacobian(x).cast<float>();
    const Eigen::Matrix<float, 2, 3> J_omega = -J_x * hat(x).cast<float>();
    samples_[i].du.head<6>() << J_x.row(0).transpose(), J_omega.row(0).transpose();
    samples_[i].dv.head<6>() << J_x.row(1).transpose(), J_omega.row(1).transpose();
  }
}

void DenseAlignment::refine_directions(std::size_t points) {
  for (std::size_t i = 0; i < points; ++i) {
    samples_[i].du *= 2;
    samples_[i].dv *= 2;
  }
}

bool DenseAlignment::prepare_patch(const cv::Mat& image, int level, const AlignmentPoint& point,
                                   Sample& sample) {
  const Eigen::Vector2f uv = to_level(point.uv.x(), point.uv.y(), level);
  Bilinear window{};
  if (!in_front_of_camera(point.x) || !window_at(image, uv.x(), uv.y(), kSize / 2 + 1, kSize + 2, window))
    return false;
  Floats8 rows[kSize + 2];
  sample_6x6(window, rows);
  const auto prepare = [&](const Floats8* first, Floats8 Pixels::*half) {
    sample.value.*half = four_of_each<1>(first[1], first[2]);
    sample.gradient_u.*half =
        0.5F * (four_of_each<2>(first[1], first[2]) - four_of_each<0>(first[1], first[2]));
    sample.gradient_v.*half =
        0.5F * (four_of_each<1>(first[2], first[3]) - four_of_each<1>(first[0], first[1]));
  };
  prepare(rows, &Pixels::upper);
  prepare(rows + 2, &Pixels::lower);
  return true;
}

void DenseAlignment::prepare_patches(const cv::Mat& image, int level,
                                     std::span<const AlignmentPoint> points) {
  double inverse_depths = 0;
  int usable = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    usable_[i] = prepare_patch(image, level, points[i], samples_[i]) ? 1 : 0;
    if (usable_[i] == 0) continue;
    inverse_depths += 1 / points[i].x.z();
    ++usable;
  }
  mean_inverse_depth_ = inverse_depths / std::max(1, usable);
}

/// The upper triangle of blocks of H: (pose, pose), (pose, light), (light, light).
inline void DenseAlignment::Cost::add(const Sample& s, const Pixels& r, const Pixels& w) {
  const auto times = [](const Pixels& a, const Pixels& b) {
    return Pixels{a.upper * b.upper, a.lower * b.lower};
  };
  const auto dot = [](const Pixels& a, const Pixels& b) { return a.lower * b.lower + a.upper * b.upper; };
  const auto total = [](const Pixels& a) { return a.upper + a.lower; };
  const Pixels wr = times(w, r), wu = times(w, s.gradient_u), wv = times(w, s.gradient_v),
               wt = times(w, s.value);
  // sum over the pixels of w J J^T with J = gu du + gv dv, then value, then 1: all but du, dv are sums.
  const Floats8 of_pose =
      sums_of_rows({dot(wu, s.gradient_u), dot(wu, s.gradient_v), dot(wv, s.gradient_v), dot(wu, s.value),
                    dot(wv, s.value), total(wu), total(wv), dot(wr, r)});
  const Floats8 of_light = sums_of_rows(
      {dot(wt, s.value), total(wt), total(w), dot(wu, r), dot(wv, r), dot(wt, r), total(wr), Floats8{}});
  squares += of_pose[7];
  weights += of_light[2];
  const Row along_u = of_pose[0] * s.du + of_pose[1] * s.dv;
  const Row along_v = of_pose[1] * s.du + of_pose[2] * s.dv;
  H.noalias() += along_u * s.du.transpose();
  H.noalias() += along_v * s.dv.transpose();
  H.col(6) += of_pose[3] * s.du + of_pose[4] * s.dv;
  H.col(7) += of_pose[5] * s.du + of_pose[6] * s.dv;
  H(6, 6) += of_light[0];
  H(6, 7) += of_light[1];
  H(7, 7) += of_light[2];
  g += of_light[3] * s.du + of_light[4] * s.dv;
  g(6) += of_light[5];
  g(7) += of_light[6];
}

void DenseAlignment::evaluate(const PinholeCamera& level_camera, const cv::Mat& image,
                              std::span<const AlignmentPoint> points, const DenseAlignmentResult& state,
                              Cost& cost) const {
  const Matrix3 R = state.T_cur_prev.rotation();
  const Vector3& t = state.T_cur_prev.translation();
  cost.H.setZero();
  cost.g.setZero();
  cost.squares = cost.weights = 0;
  const float huber = options_.huber_grey;
  int visible = 0;
  int usable = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (usable_[i] == 0) continue;
    ++usable;
    const Vector3 x = R * points[i].x + t;
    if (!in_front_of_camera(x)) continue;
    const Vector2 uv = level_camera.project(x);
    Bilinear window{};
    if (!(uv.cwiseAbs().maxCoeff() < 1e5) ||
        !window_at(image, static_cast<float>(uv.x()), static_cast<float>(uv.y()), kSize / 2, kSize, window)) {
      continue;
    }
    ++visible;
    const Sample& s = samples_[i];
    const Pixels residual{sample_4x2(window, 0) - state.gain * s.value.upper - state.offset,
                          sample_4x2(window, 2) - state.gain * s.value.lower - state.offset};
    cost.add(s, residual, {huber_weights(residual.upper, huber), huber_weights(residual.lower, huber)});
  }
  cost.H.bottomLeftCorner<2, 6>() = cost.H.topRightCorner<6, 2>().transpose();
  cost.H(7, 6) = cost.H(6, 7);
  cost.rms = cost.weights > 0 ? std::sqrt(cost.squares / cost.weights) : 1e9F;
  cost.visible = usable > 0 ? static_cast<float>(visible) / static_cast<float>(usable) : 0.0F;
}

bool DenseAlignment::align_level(const PinholeCamera& level_camera, const cv::Mat& image,
                                 std::span<const AlignmentPoint> points, DenseAlignmentResult& state) const {
  Cost cost;
  DenseAlignmentResult best = state;
  best.rms = 1e9F;
  for (int iteration = 0; iteration <= options_.max_iterations; ++iteration) {
    evaluate(level_camera, image, points, state, cost);
    if (cost.visible < 0.2F || !(cost.rms < best.rms)) break;  // the last step did not help
    best = state;
    best.rms = cost.rms;
    best.visible = cost.visible;
    Matrix8 H = cost.H.cast<double>();
    for (int k = 0; k < 8; ++k) H(k, k) = H(k, k) * (1 + 1e-5) + 1e-3;
    const Vector8 step = solve_symmetric(H, cost.g.cast<double>());
    if (!step.allFinite()) break;
    // Inverse composition: the step moves the earlier frame, so its inverse goes to the right.
    state.T_cur_prev = state.T_cur_prev * SE3::exp(-step.head<6>());
    state.gain += static_cast<float>(step(6));
    state.offset += static_cast<float>(step(7));
    const double moved_px =
        level_camera.fx * (step.head<3>().norm() * mean_inverse_depth_ + step.segment<3>(3).norm());
    if (moved_px < options_.settled_px) {
      best.T_cur_prev = state.T_cur_prev;  // too small to be worth another look
      best.gain = state.gain;
      best.offset = state.offset;
      break;
    }
  }
  const bool moved = best.rms < 1e9F;
  state = best;
  return moved;
}

DenseAlignmentResult DenseAlignment::align(const PinholeCamera& camera, const ImagePyramid& previous,
                                           const ImagePyramid& current,
                                           std::span<const AlignmentPoint> points,
                                           const SE3& T_cur_prev_start, int finest_level) {
  points = points.first(std::min(points.size(), samples_.size()));
  DenseAlignmentResult state;
  state.T_cur_prev = T_cur_prev_start;
  state.gain = brightness_ratio(previous.level(options_.coarsest_level),
                                current.level(options_.coarsest_level), options_.light_change);
  state.offset = kMidGrey * (state.gain - 1);
  prepare_directions(camera.at_level(options_.coarsest_level), points);
  for (int level = options_.coarsest_level; level >= std::max(finest_level, options_.finest_level); --level) {
    const PinholeCamera level_camera = camera.at_level(level);
    if (level < options_.coarsest_level) refine_directions(points.size());
    prepare_patches(previous.level(level), level, points);
    DenseAlignmentResult refined = state;
    if (align_level(level_camera, current.level(level), points, refined)) {
      state = refined;
      state.converged = true;
    }
  }
  state.offset += kMidGrey * (1 - state.gain);
  return state;
}

}  // namespace twofold
