#include "mapping/loop_consensus.hpp"

#include <vector>

#include "geometry/absolute_orientation.hpp"
#include "geometry/ransac.hpp"

namespace twofold {
namespace {

class PoseFromThreePoints {
 public:
  using Model = SE3;
  static constexpr int kSampleSize = 3;

  PoseFromThreePoints(const Rig& rig, std::span<const MotionObservation> matches, double min_disparity_px)
      : rig_(rig) {
    for (const MotionObservation& match : matches) {
      const Vector3 z = match.z.cast<double>();
      if (match.information.z() > 0 && z.x() - z.z() > min_disparity_px)
        data_.push_back({match.x_ref, z, match.information.x()});
    }
  }
  [[nodiscard]] int size() const { return static_cast<int>(data_.size()); }
  void fit(std::span<const int, 3> sample, std::vector<SE3>& models) const {
    std::array<Vector3, 3> x_c;
    std::array<Vector3, 3> x_ref;
    for (std::size_t i = 0; i < 3; ++i) {
      const Datum& datum = data_[static_cast<std::size_t>(sample[i])];
      x_c[i] = rig_.unproject(datum.z);
      x_ref[i] = datum.x_ref;
    }
    if (const auto T_c_ref = align_rigid(x_c, x_ref)) models.push_back(*T_c_ref);
  }
  [[nodiscard]] double squared_residual(const SE3& T_c_ref, int i) const {
    const Datum& datum = data_[static_cast<std::size_t>(i)];
    const Vector3 x_c = T_c_ref * datum.x_ref;
    if (!in_front_of_camera(x_c)) return 1e12;
    return datum.information * (rig_.camera.project(x_c) - datum.z.head<2>()).squaredNorm();
  }

 private:
  struct Datum {
    Vector3 x_ref;
    Vector3 z;
    double information;
  };
  const Rig& rig_;
  std::vector<Datum> data_;
};

}  // namespace

std::optional<SE3> consensus_pose(const Rig& rig, std::span<const MotionObservation> matches, int min_inliers,
                                  const LoopConsensusOptions& options) {
  const PoseFromThreePoints estimator(rig, matches, options.min_disparity_px);
  const auto found = ransac(estimator, {.threshold = options.inlier_sigmas,
                                        .confidence = options.confidence,
                                        .max_iterations = options.max_samples});
  if (!found || static_cast<int>(found->inliers.size()) < min_inliers) return std::nullopt;
  return found->model;
}

}  // namespace twofold
