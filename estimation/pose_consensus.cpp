#include "estimation/pose_consensus.hpp"

#include "base/option_check.hpp"
#include "geometry/absolute_orientation.hpp"
#include "geometry/ransac.hpp"

namespace twofold {

std::string PoseConsensusOptions::invalid_reason() const {
  return OptionCheck()
      .above("inlier_sigmas", inlier_sigmas, 0)
      .at_least("max_samples", max_samples, 1)
      .that(confidence > 0 && confidence < 1, "confidence", "in (0, 1)", confidence)
      .at_least("min_disparity_px", min_disparity_px, 0)
      .reason();
}

namespace {

/// In the left image, in variances.
double squared_error(const PinholeCamera& camera, const Vector3& x_c, const Vector2& uv, double information) {
  if (!in_front_of_camera(x_c)) return 1e12;
  return information * (camera.project(x_c) - uv).squaredNorm();
}

}  // namespace

/// For geometry/ransac.hpp: T_c_ref.
class PoseConsensus::ThreePoints {
 public:
  using Model = SE3;
  static constexpr int kSampleSize = 3;

  ThreePoints(const PinholeCamera& camera, std::span<const Pair> pairs) : camera_(camera), pairs_(pairs) {}
  [[nodiscard]] int size() const { return static_cast<int>(pairs_.size()); }
  void fit(std::span<const int, 3> sample, std::vector<SE3>& models) const {
    std::array<Vector3, 3> x_c;
    std::array<Vector3, 3> x_ref;
    for (std::size_t i = 0; i < 3; ++i) {
      x_c[i] = pair(sample[i]).x_c;
      x_ref[i] = pair(sample[i]).x_ref;
    }
    if (const auto T_c_ref = align_rigid(x_c, x_ref)) models.push_back(*T_c_ref);
  }
  [[nodiscard]] double squared_residual(const SE3& T_c_ref, int i) const {
    return squared_error(camera_, T_c_ref * pair(i).x_ref, pair(i).uv, pair(i).information);
  }

 private:
  [[nodiscard]] const Pair& pair(int i) const { return pairs_[static_cast<std::size_t>(i)]; }

  const PinholeCamera& camera_;
  std::span<const Pair> pairs_;
};

PoseConsensus::PoseConsensus(const Rig& rig, std::size_t capacity, const PoseConsensusOptions& options)
    : rig_(rig), options_(options) {
  pairs_.reserve(capacity);
  models_.reserve(1);
}

std::optional<SE3> PoseConsensus::find(std::span<const MotionObservation> matches, int min_inliers) {
  pairs_.clear();
  for (const MotionObservation& match : matches) {
    const Vector3 z = match.z.cast<double>();
    if (pairs_.size() == pairs_.capacity()) break;
    if (match.information.z() > 0 && z.x() - z.z() > options_.min_disparity_px) {
      pairs_.push_back({match.x_ref, rig_.unproject(z), z.head<2>(), match.information.x()});
    }
  }
  const ThreePoints estimator(rig_.camera, pairs_);
  const auto best = best_model(estimator,
                               {.threshold = options_.inlier_sigmas,
                                .confidence = options_.confidence,
                                .max_iterations = options_.max_samples},
                               models_);
  if (!best || best->inliers < min_inliers) return std::nullopt;
  return best->model;
}

bool PoseConsensus::explains(const SE3& T_c_ref, const MotionObservation& match) const {
  return squared_error(rig_.camera, T_c_ref * match.x_ref, match.z.head<2>().cast<double>(),
                       match.information.x()) <= options_.inlier_sigmas * options_.inlier_sigmas;
}

}  // namespace twofold
