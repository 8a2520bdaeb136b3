#include "estimation/pose_consensus.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/option_check.hpp"
#include "camera/measurement.hpp"
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

constexpr double kSideSigmas =
    4;  // by which a side of a right sample may differ: one of 16,000 does by chance
constexpr double kFarOff = 1e12;  // variances of a point that is not in front of the camera

/// In the left image, in variances.
double squared_error(const PinholeCamera& camera, const Vector3& x_c, const Vector2& uv, double information) {
  if (!in_front_of_camera(x_c)) return kFarOff;
  return information * (camera.project(x_c) - uv).squaredNorm();
}

}  // namespace

/// For geometry/ransac.hpp: T_c_ref.
class PoseConsensus::ThreePoints {
 public:
  using Model = SE3;
  static constexpr int kSampleSize = 3;

  ThreePoints(const Rig& rig, std::span<const Pair> pairs, std::span<const Batch> batches)
      : camera_(rig.camera),
        inv_f_(1 / rig.camera.fx),
        inv_fb_(inv_f_ / rig.baseline),
        pairs_(pairs),
        batches_(batches) {}
  [[nodiscard]] int size() const { return static_cast<int>(pairs_.size()); }
  void fit(std::span<const int, 3> sample, std::vector<SE3>& models) const {
    std::array<Vector3, 3> x_c;
    std::array<Vector3, 3> x_ref;
    for (std::size_t i = 0; i < 3; ++i) {
      const Pair& pair = pairs_[static_cast<std::size_t>(sample[i])];
      x_c[i] = pair.x_c;
      x_ref[i] = pair.x_ref;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      if (!agree_on_side(sample[i], sample[(i + 1) % 3])) return;
    }
    if (const auto T_c_ref = align_rigid(x_c, x_ref)) models.push_back(*T_c_ref);
  }
  [[nodiscard]] ModelScore score(const SE3& T_c_ref, double threshold2, double enough) const {
    constexpr std::size_t kBetweenLooks = 8;  // batches: a look at the sum costs as much as one of them
    const Matrix3 R = T_c_ref.rotation();
    const std::size_t filled_up = kObservationLanes * batches_.size() - pairs_.size();
    ObservationLanes inliers{}, score{};
    score[0] = -threshold2 * static_cast<double>(filled_up);
    for (std::size_t b = 0; b < batches_.size(); ++b) {
      ObservationLanes error;
      measure(R, T_c_ref.translation(), batches_[b], error);
      const auto within = error <= threshold2;
      score += within ? error : ObservationLanes{} + threshold2;
      inliers += within ? ObservationLanes{} + 1 : ObservationLanes{};
      if (b % kBetweenLooks == kBetweenLooks - 1 && sum(score) >= enough) break;
    }
    return {sum(score), static_cast<int>(sum(inliers))};
  }

 private:
  /// Whether two points are as far from each other in both frames, up to what their measurements leave open:
  /// most samples have a wrong match, and need be neither aligned nor scored.
  [[nodiscard]] bool agree_on_side(int first, int second) const {
    const auto i = static_cast<std::size_t>(first), j = static_cast<std::size_t>(second);
    const double sigma_i = sigma(i), sigma_j = sigma(j);
    const Side ref = side(pairs_[i].x_ref, sigma_i, pairs_[j].x_ref, sigma_j);
    const Side now = side(pairs_[i].x_c, sigma_i, pairs_[j].x_c, sigma_j);
    const double difference = now.length - ref.length;
    // Where the reference frame is no camera's, but the map's, a place in it says nothing of its error.
    const double variance = now.variance + std::max(now.variance, ref.variance);
    return difference * difference <= kSideSigmas * kSideSigmas * variance;
  }
  struct Side {
    double length, variance;
  };
  /// Disparity errs along the point's ray, the place in the image across it.
  [[nodiscard]] Side side(const Vector3& a, double sigma_a, const Vector3& b, double sigma_b) const {
    const Vector3 ab = b - a;
    const double squared = std::max(ab.squaredNorm(), 1e-12);
    const double scale_a = a.z() * sigma_a, scale_b = b.z() * sigma_b;
    const double along_a = scale_a * ab.dot(a), along_b = scale_b * ab.dot(b);
    const double along = (along_a * along_a + along_b * along_b) / squared;
    return {std::sqrt(squared),
            2 * along * inv_fb_ * inv_fb_ + (scale_a * scale_a + scale_b * scale_b) * inv_f_ * inv_f_};
  }
  /// Of where a point is seen [px].
  [[nodiscard]] double sigma(std::size_t i) const {
    return 1 / std::sqrt(batches_[i / kObservationLanes].information[i % kObservationLanes]);
  }
  static double sum(const ObservationLanes& lanes) { return (lanes[0] + lanes[1]) + (lanes[2] + lanes[3]); }

  /// As squared_error.
  [[gnu::always_inline]] void measure(const Matrix3& R, const Vector3& t, const Batch& b,
                                      ObservationLanes& squared_errors) const {
    const ObservationLanes x = R(0, 0) * b.x + R(0, 1) * b.y + R(0, 2) * b.z + t.x();
    const ObservationLanes y = R(1, 0) * b.x + R(1, 1) * b.y + R(1, 2) * b.z + t.y();
    const ObservationLanes z = R(2, 0) * b.x + R(2, 1) * b.y + R(2, 2) * b.z + t.z();
    const ObservationLanes inv_z = 1.0 / z;
    const ObservationLanes du = camera_.fx * x * inv_z + (camera_.cx - b.u);
    const ObservationLanes dv = camera_.fy * y * inv_z + (camera_.cy - b.v);
    squared_errors = z > 0 ? b.information * (du * du + dv * dv) : ObservationLanes{} + kFarOff;
  }

  const PinholeCamera& camera_;
  double inv_f_, inv_fb_;  // of the focal length, and of its product with the baseline
  std::span<const Pair> pairs_;
  std::span<const Batch> batches_;
};

PoseConsensus::PoseConsensus(const Rig& rig, std::size_t capacity, const PoseConsensusOptions& options)
    : rig_(rig), options_(options) {
  pairs_.reserve(capacity);
  batches_.reserve((capacity + kObservationLanes - 1) / kObservationLanes);
  models_.reserve(1);
}

void PoseConsensus::add(const MotionObservation& match, const Vector3& x_c) {
  const std::size_t lane = pairs_.size() % kObservationLanes;
  if (lane == 0) {
    const ObservationLanes nowhere = ObservationLanes{} + std::numeric_limits<double>::quiet_NaN();
    batches_.push_back({nowhere, nowhere, nowhere, nowhere, nowhere, nowhere});
  }
  Batch& batch = batches_.back();
  batch.x[lane] = match.x_ref.x();
  batch.y[lane] = match.x_ref.y();
  batch.z[lane] = match.x_ref.z();
  batch.u[lane] = match.pixel.x();
  batch.v[lane] = match.pixel.y();
  batch.information[lane] = match.information.x();
  pairs_.push_back({match.x_ref, x_c});
}

std::optional<SE3> PoseConsensus::find(std::span<const MotionObservation> matches, int min_inliers) {
  pairs_.clear();
  batches_.clear();
  for (const MotionObservation& match : matches) {
    const StereoPixel z = match.pixel.cast<double>();
    if (pairs_.size() == pairs_.capacity()) break;
    if (weighs_right(match.information) && z.x() - z.z() > options_.min_disparity_px)
      add(match, rig_.unproject(z));
  }
  const ThreePoints estimator(rig_, pairs_, batches_);
  const auto best = best_model(estimator,
                               {.threshold = options_.inlier_sigmas,
                                .confidence = options_.confidence,
                                .max_iterations = options_.max_samples},
                               models_);
  if (!best || best->inliers < min_inliers) return std::nullopt;
  return best->model;
}

bool PoseConsensus::explains(const SE3& T_c_ref, const MotionObservation& match) const {
  return squared_error(rig_.camera, T_c_ref * match.x_ref, match.pixel.head<2>().cast<double>(),
                       match.information.x()) <= options_.inlier_sigmas * options_.inlier_sigmas;
}

}  // namespace twofold
