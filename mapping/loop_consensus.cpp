#include "mapping/loop_consensus.hpp"

#include <vector>

#include "geometry/absolute_orientation.hpp"
#include "geometry/ransac.hpp"

namespace twofold {
namespace {

constexpr double kInlierSigmas = 4;  // a pose of three noisy depths is rough
constexpr int kMaxSamples = 400;

class PoseFromThreePoints {
 public:
  using Model = SE3;
  static constexpr int kSampleSize = 3;

  PoseFromThreePoints(const Rig& rig, std::span<const MotionObservation> matches) : rig_(rig) {
    for (const MotionObservation& match : matches) {
      const Vector3 z = match.z.cast<double>();
      if (match.information.z() > 0 && z.x() - z.z() > 0.5)
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
    if (!(x_c.z() > 1e-3)) return 1e12;
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

std::optional<SE3> consensus_pose(const Rig& rig, std::span<const MotionObservation> matches,
                                  int min_inliers) {
  const PoseFromThreePoints estimator(rig, matches);
  const auto found =
      ransac(estimator, {.threshold = kInlierSigmas, .confidence = 0.99, .max_iterations = kMaxSamples});
  if (!found || static_cast<int>(found->inliers.size()) < min_inliers) return std::nullopt;
  return found->model;
}

}  // namespace twofold
