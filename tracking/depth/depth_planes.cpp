#include "tracking/depth/depth_planes.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/median.hpp"
#include "base/option_check.hpp"
#include "estimation/median_chi2.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxPlanes = 6000;  // beyond, the smallest are left out
/// Of eight rows, so that those had at any time lie evenly.
constexpr std::array<int, 8> kRowOrder{0, 4, 2, 6, 1, 5, 3, 7};
constexpr int kEnoughCells = 8;  // of 3 x 3: a regression may lack one

}  // namespace

std::string DepthPlaneOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("columns", columns, 3)
      .share("min_readings_share", min_readings_share)
      .at_least("many_columns", many_columns, 1)
      .above("max_scatter", max_scatter, 0)
      .within("min_cosine", min_cosine, 0, 1)
      .above("min_noise", min_noise, 0)
      .reason();
}

DepthPlanes::DepthPlanes(const Rig& rig, const DepthPlaneOptions& options)
    : rig_(rig),
      options_(options),
      // Inverse depth is disparity / (f b), whose noise the rig knows.
      sigma_floor_(options.min_noise * rig.noise.depth_sigma_px / (rig.camera.fx * rig.baseline)) {
  int cell_px = std::max(2, rig.camera.width / options.columns);
  for (Means& means : means_) {
    means.cell_px = cell_px;
    means.columns = rig.camera.width / cell_px;
    means.rows = rig.camera.height / cell_px;
    means.values.resize(static_cast<std::size_t>(means.columns) * static_cast<std::size_t>(means.rows));
    cell_px *= 2;
  }
  plane_of_cell_.resize(means_[0].values.size());
  planes_.reserve(kMaxPlanes);
  variances_.reserve(means_[0].values.size());
}

void DepthPlanes::read(const cv::Mat& depth) {
  read_finest(depth);
  for (int size = 1; size < kSizes; ++size) halve(means_[size - 1], means_[size]);
  planes_.clear();
  std::fill(plane_of_cell_.begin(), plane_of_cell_.end(), kNone);
  for (int size = kSizes - 1; size >= 0; --size) add_planes(size);
}

const DepthPlanes::Plane* DepthPlanes::at(const Vector2& uv) const {
  const Means& finest = means_[0];
  const double c = std::floor((uv.x() + 0.5) / finest.cell_px),
               r = std::floor((uv.y() + 0.5) / finest.cell_px);
  if (!(c >= 0 && c < finest.columns && r >= 0 && r < finest.rows)) return nullptr;
  const auto cell =
      static_cast<std::size_t>(r) * static_cast<std::size_t>(finest.columns) + static_cast<std::size_t>(c);
  const std::int16_t plane = plane_of_cell_[cell];
  return plane == kNone ? nullptr : &planes_[static_cast<std::size_t>(plane)];
}

double DepthPlanes::typical_depth() const {
  double sum = 0;
  for (const Plane& plane : planes_) sum += 1 / plane.x.z();
  return sum > 0 ? static_cast<double>(planes_.size()) / sum : 0;
}

/// No mean where holes lie to one side, from where it would be drawn away.
void DepthPlanes::read_finest(const cv::Mat& depth) {
  Means& means = means_[0];
  const int px = means.cell_px;
  for (std::size_t i = 0; i < means.values.size(); ++i) {
    const int row = static_cast<int>(i) / means.columns, column = static_cast<int>(i) % means.columns;
    double sum = 0;
    int count = 0, left = 0, upper = 0;
    for (int v = 0; v < px; ++v) {
      const auto* line = depth.ptr<std::uint16_t>(row * px + v) + column * px;
      for (int u = 0; u < px; ++u) {
        const double metres = line[u] * rig_.depth_unit;
        if (!(metres >= rig_.depth_min && metres <= rig_.depth_max)) continue;
        sum += 1 / metres;
        ++count;
        left += 2 * u + 1 - px;
        upper += 2 * v + 1 - px;
      }
    }
    const bool lopsided = 2 * std::max(std::abs(left), std::abs(upper)) > count;  // by a quarter of a pixel
    means.values[i] = count >= options_.min_readings_share * px * px && !lopsided ? sum / count : 0;
  }
}

void DepthPlanes::halve(const Means& finer, Means& coarser) const {
  for (int row = 0; row < coarser.rows; ++row) {
    for (int column = 0; column < coarser.columns; ++column) {
      const double a = finer.at(2 * column, 2 * row), b = finer.at(2 * column + 1, 2 * row);
      const double c = finer.at(2 * column, 2 * row + 1), d = finer.at(2 * column + 1, 2 * row + 1);
      const bool all = a > 0 && b > 0 && c > 0 && d > 0;
      coarser.values[static_cast<std::size_t>(row * coarser.columns + column)] =
          all ? 0.25 * (a + b + c + d) : 0;
    }
  }
}

bool DepthPlanes::regress(const Means& means, int column, int row, Regression& regression) {
  const double middle = means.at(column, row);
  if (middle == 0) return false;
  Vector3 g = Vector3::Zero();
  Vector3 of_missing = Vector3::Zero();
  double squares = 0;
  int count = 0;
  for (int r = -1; r <= 1; ++r) {
    for (int c = -1; c <= 1; ++c) {
      const double mean = means.at(column + c, row + r);
      if (mean == 0) {
        of_missing = Vector3(1, c, r);
        continue;
      }
      const double difference = mean - middle;
      g += difference * Vector3(1, c, r);
      squares += difference * difference;
      ++count;
    }
  }
  if (count < kEnoughCells) return false;
  static_assert(kEnoughCells == 8, "one cell may be missing");
  const Vector3 full(1.0 / 9, 1.0 / 6, 1.0 / 6);  // the inverse of sum j j^T over all nine
  regression.inverse = full.asDiagonal();
  if (count < 9) {  // Sherman and Morrison
    const Vector3 v = full.cwiseProduct(of_missing);
    regression.inverse += v * v.transpose() / (1 - of_missing.dot(v));
  }
  regression.theta = regression.inverse * g;
  regression.variance = std::max(0.0, squares - regression.theta.dot(g)) / (count - 3);
  regression.theta[0] += middle;
  return true;
}

/// Of means about planes, in standard deviations: of edges and curved surfaces the median knows nothing.
double DepthPlanes::scatter(const Means& means) {
  variances_.clear();
  Regression regression;
  const int step = means.columns > options_.many_columns ? 3 : 1;
  for (int row = 1; row + 1 < means.rows; row += step) {
    for (int column = 1; column + 1 < means.columns; column += step) {
      if (regress(means, column, row, regression)) variances_.push_back(regression.variance);
    }
  }
  if (variances_.empty()) return sigma_floor_;
  return std::max(sigma_floor_, std::sqrt(median(std::span(variances_)) / (median_chi2(6) / 6)));
}

void DepthPlanes::add_planes(int size) {
  means_[size].sigma = scatter(means_[size]);
  const std::size_t larger = planes_.size();
  if (larger == kMaxPlanes || add_rows(size, 0, 1)) return;
  // Full before the last row. Rows evenly over the image instead: its lower part would have no say.
  planes_.resize(larger);
  for (std::int16_t& plane : plane_of_cell_) {
    if (plane >= static_cast<int>(larger)) plane = kNone;
  }
  for (const int first : kRowOrder) {
    if (!add_rows(size, first, static_cast<int>(kRowOrder.size()))) return;
  }
}

/// Planes of every step-th row of cells; whether there is room for more.
bool DepthPlanes::add_rows(int size, int first_row, int step) {
  const Means& means = means_[size];
  const int finest = 1 << size;  // cells of the finest size along a side
  for (int row = 1 + first_row; row + 1 < means.rows; row += step) {
    for (int column = 1; column + 1 < means.columns; ++column) {
      const int first = row * finest * means_[0].columns + column * finest;
      if (plane_of_cell_[static_cast<std::size_t>(first)] != kNone || !add_plane(means, column, row))
        continue;
      for (int r = 0; r < finest; ++r) {
        std::fill_n(plane_of_cell_.begin() + first + r * means_[0].columns, finest,
                    static_cast<std::int16_t>(planes_.size() - 1));
      }
    }
  }
  return planes_.size() < kMaxPlanes;
}

bool DepthPlanes::add_plane(const Means& means, int column, int row) {
  Regression fit;
  if (planes_.size() == kMaxPlanes || !regress(means, column, row, fit)) return false;
  if (fit.variance > options_.max_scatter * options_.max_scatter * means.sigma * means.sigma) return false;
  const PinholeCamera& camera = rig_.camera;
  const double half = 0.5 * (means.cell_px - 1);
  const Vector3 ray = camera.unproject(Vector2(column * means.cell_px + half, row * means.cell_px + half));
  // m . ray(u, v) = w: linear in theta.
  Matrix3 m_theta = Matrix3::Zero();
  m_theta(0, 1) = camera.fx / means.cell_px;
  m_theta(1, 2) = camera.fy / means.cell_px;
  m_theta.row(2) << 1, -ray.x() * m_theta(0, 1), -ray.y() * m_theta(1, 2);
  Plane plane;
  plane.m = m_theta * fit.theta;
  plane.covariance = means.sigma * means.sigma * m_theta * fit.inverse * m_theta.transpose();
  plane.x = ray / means.at(column, row);
  plane.sigma = means.sigma;
  if (!(fit.theta[0] > options_.min_cosine * plane.m.norm() * ray.norm())) return false;  // w = m . ray
  planes_.push_back(plane);
  return true;
}

}  // namespace twofold
