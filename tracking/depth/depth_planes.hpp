#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "camera/rig.hpp"

namespace twofold {

struct DepthPlaneOptions {
  int columns = 160;                 ///< of the finest cells in a row of the image, about, >= 3
  double min_readings_share = 0.75;  ///< of a cell's pixels: with fewer it has no mean, in (0, 1]
  int many_columns = 60;             ///< in rows of more cells every third is asked how means scatter, >= 1
  /// About a plane, times what is usual in cells of that size: more is curved, or an edge, > 0.
  double max_scatter = 2;
  double min_cosine = 0.1;  ///< between ray and normal: steeper surfaces are known badly, in [0, 1]
  /// A perfect sensor's means still err by what depth units round off: of the rig's noise of one reading,
  /// > 0.
  double min_noise = 0.01;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// A depth image as planes: large ones where the surface is flat, small ones where it is not.
///
/// In inverse depth a plane is linear in the image. The image is cut into square cells of four sizes, each
/// twice the one before; a plane is fitted to the mean inverse depths of 3 x 3 cells of the largest size at
/// which these lie in one. How exactly means are known is not taken from the sensor's data sheet, for
/// neighbouring readings err together: it is how far they scatter about such planes, for each size.
class DepthPlanes {
 public:
  struct Plane {
    Vector3 x{0, 0, 0};  ///< the middle cell's point, from its own readings alone, in the camera's frame [m]
    Vector3 m{0, 0, 0};  ///< the plane m . x = 1 [1/m]
    Matrix3 covariance = Matrix3::Zero();  ///< of m [1/m^2]
    double sigma = 0;                      ///< standard deviation of the point's inverse depth [1/m]
  };

  DepthPlanes(const Rig& rig, const DepthPlaneOptions& options);

  /// Reads a depth image (Frame::depth) of the rig. No allocation.
  void read(const cv::Mat& depth);

  /// One for each cell that is part of no larger one.
  [[nodiscard]] const std::vector<Plane>& planes() const { return planes_; }
  /// Depth whose inverse is the mean of the planes' [m]; 0 if there are none.
  [[nodiscard]] double typical_depth() const;
  /// The plane that a level-0 pixel shows; null where there is none, and outside.
  [[nodiscard]] const Plane* at(const Vector2& uv) const;

 private:
  static constexpr int kSizes = 4;
  static constexpr std::int16_t kNone = -1;

  /// Mean inverse depths of all cells of one size, in rows; 0: too few readings  [1/m].
  struct Means {
    int cell_px = 0, columns = 0, rows = 0;
    double sigma = 0;
    std::vector<double> values;

    [[nodiscard]] double at(int column, int row) const {
      return values[static_cast<std::size_t>(row * columns + column)];
    }
  };
  /// w = theta . (1, dc, dr) around a cell.
  struct Regression {
    Vector3 theta{0, 0, 0};
    Matrix3 inverse = Matrix3::Zero();  ///< of the normal equations' matrix
    double variance = 0;                ///< of the residuals
  };

  void read_finest(const cv::Mat& depth);
  void halve(const Means& finer, Means& coarser) const;
  [[nodiscard]] static bool regress(const Means& means, int column, int row, Regression& regression);
  [[nodiscard]] double scatter(const Means& means);
  void add_planes(int size);
  bool add_rows(int size, int first_row, int step);
  [[nodiscard]] bool add_plane(const Means& means, int column, int row);

  Rig rig_;
  DepthPlaneOptions options_;
  double sigma_floor_;
  std::array<Means, kSizes> means_;          ///< from fine to coarse
  std::vector<std::int16_t> plane_of_cell_;  ///< of the finest size; kNone: none
  std::vector<Plane> planes_;
  std::vector<double> variances_;  ///< scratch
};

}  // namespace twofold
