#include "tracking/dense_alignment.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace twofold {
namespace {

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

float sample(const Bilinear& w, int r, int c) {
  const std::uint8_t* p = w.p + r * w.stride + c;
  return w.w00 * static_cast<float>(p[0]) + w.w01 * static_cast<float>(p[1]) +
         w.w10 * static_cast<float>(p[w.stride]) + w.w11 * static_cast<float>(p[w.stride + 1]);
}

}  // namespace

DenseAlignment::DenseAlignment(std::size_t capacity, const DenseAlignmentOptions& options)
    : options_(options), samples_(capacity), usable_(capacity) {}

bool DenseAlignment::prepare_point(const PinholeCamera& level_camera, const cv::Mat& image, int level,
                                   const AlignmentPoint& point, Sample& out) const {
  const float s = std::ldexp(1.0F, -level);
  const float u = (point.uv.x() + 0.5F) * s - 0.5F;
  const float v = (point.uv.y() + 0.5F) * s - 0.5F;
  Bilinear window{};
  if (point.x.z() < 1e-3 || !window_at(image, u, v, kSize / 2 + 1, kSize + 2, window)) return false;
  // d pixel / d (v, omega) for x -> exp(delta) x
  const Eigen::Matrix<float, 2, 3> J_x = level_camera.project_jacobian(point.x).cast<float>();
  Eigen::Matrix<float, 2, 6> J;
  J.leftCols<3>() = J_x;
  J.rightCols<3>() = -J_x * hat(point.x).cast<float>();
  float values[(kSize + 2) * (kSize + 2)];
  for (int r = 0; r < kSize + 2; ++r) {
    for (int c = 0; c < kSize + 2; ++c) values[r * (kSize + 2) + c] = sample(window, r, c);
  }
  for (int r = 0; r < kSize; ++r) {
    for (int c = 0; c < kSize; ++c) {
      const float* p = values + (r + 1) * (kSize + 2) + c + 1;
      const float gu = 0.5F * (p[1] - p[-1]);
      const float gv = 0.5F * (p[kSize + 2] - p[-(kSize + 2)]);
      const int i = r * kSize + c;
      for (int k = 0; k < 6; ++k) out.jacobian[i][k] = gu * J(0, k) + gv * J(1, k);
      out.jacobian[i][6] = p[0];
      out.jacobian[i][7] = 1;
      out.value[i] = p[0];
    }
  }
  return true;
}

void DenseAlignment::prepare(const PinholeCamera& level_camera, const cv::Mat& image, int level,
                             std::span<const AlignmentPoint> points) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    usable_[i] = prepare_point(level_camera, image, level, points[i], samples_[i]) ? 1 : 0;
  }
}

void DenseAlignment::evaluate(const PinholeCamera& level_camera, const cv::Mat& image,
                              std::span<const AlignmentPoint> points, const DenseAlignmentResult& state,
                              Cost& cost) const {
  const Matrix3 R = state.T_cur_prev.rotation();
  const Vector3& t = state.T_cur_prev.translation();
  alignas(32) float H[8][8] = {};
  alignas(32) float g[8] = {};
  float squares = 0;
  float weights = 0;
  int visible = 0;
  int usable = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!usable_[i]) continue;
    ++usable;
    const Vector3 x = R * points[i].x + t;
    if (x.z() < 1e-3) continue;
    const Vector2 uv = level_camera.project(x);
    Bilinear window{};
    if (!(uv.cwiseAbs().maxCoeff() < 1e5) ||
        !window_at(image, static_cast<float>(uv.x()), static_cast<float>(uv.y()), kSize / 2, kSize, window)) {
      continue;
    }
    ++visible;
    const Sample& s = samples_[i];
    for (int p = 0; p < kArea; ++p) {
      const float residual = sample(window, p / kSize, p % kSize) - state.gain * s.value[p] - state.offset;
      const float magnitude = std::abs(residual);
      const float w = magnitude <= options_.huber_grey ? 1.0F : options_.huber_grey / magnitude;
      squares += w * residual * residual;
      weights += w;
      const float* J = s.jacobian[p];
      const float wr = w * residual;
      for (int a = 0; a < 8; ++a) {
        const float wJ = w * J[a];
        for (int b = 0; b < 8; ++b) H[a][b] += wJ * J[b];
        g[a] += wr * J[a];
      }
    }
  }
  cost.rms = weights > 0 ? std::sqrt(squares / weights) : 1e9F;
  cost.visible = usable > 0 ? static_cast<float>(visible) / static_cast<float>(usable) : 0.0F;
  for (int a = 0; a < 8; ++a) {
    for (int b = 0; b < 8; ++b) cost.H(a, b) = H[a][b];
    cost.g(a) = g[a];
  }
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
    Eigen::Matrix<double, 8, 8> H = cost.H.cast<double>();
    for (int k = 0; k < 8; ++k) H(k, k) = H(k, k) * (1 + 1e-5) + 1e-3;
    const Eigen::Matrix<double, 8, 1> step = H.ldlt().solve(cost.g.cast<double>());
    if (!step.allFinite()) break;
    // Inverse composition: the step moves the earlier frame, so its inverse goes to the right.
    state.T_cur_prev = state.T_cur_prev * SE3::exp(-step.head<6>());
    state.gain += static_cast<float>(step(6));
    state.offset += static_cast<float>(step(7));
    if (step.head<6>().norm() < options_.settled) break;
  }
  const bool moved = best.rms < 1e9F;
  state = best;
  return moved;
}

DenseAlignmentResult DenseAlignment::align(const PinholeCamera& camera, const ImagePyramid& previous,
                                           const ImagePyramid& current,
                                           std::span<const AlignmentPoint> points,
                                           const SE3& T_cur_prev_start) {
  points = points.first(std::min(points.size(), samples_.size()));
  DenseAlignmentResult state;
  state.T_cur_prev = T_cur_prev_start;
  for (int level = options_.coarsest_level; level >= options_.finest_level; --level) {
    const PinholeCamera level_camera = camera.at_level(level);
    prepare(level_camera, previous.level(level), level, points);
    DenseAlignmentResult refined = state;
    if (align_level(level_camera, current.level(level), points, refined)) {
      state = refined;
      state.converged = true;
    }
  }
  return state;
}

}  // namespace twofold
