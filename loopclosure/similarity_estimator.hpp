#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/agreement_graph.hpp"
#include "geometry/sim3.hpp"
#include "loopclosure/corner_match.hpp"
#include "loopclosure/geometric_verification.hpp"

namespace twofold {

/// A similarity and its inverse as matrices: a quaternion would be made one again for each point.
struct TwoWaySimilarity {
  explicit TwoWaySimilarity(const Sim3& S)
      : S_b_a(S),
        H_b_a(S.scale() * S.rotation()),
        H_a_b(S.rotation().transpose() / S.scale()),
        t_a_b(-(H_a_b * S.translation())),
        turn(turn_of(H_b_a)) {}
  [[nodiscard]] Vector3 to_b(const Vector3& x_a) const { return H_b_a * x_a + S_b_a.translation(); }
  [[nodiscard]] Vector3 to_a(const Vector3& x_b) const { return H_a_b * x_b + t_a_b; }

  Sim3 S_b_a;
  Matrix3 H_b_a, H_a_b;  ///< scale times rotation
  Vector3 t_a_b;
  double turn;
};

/// For geometry/ransac.hpp: S_b_a from three points known in both frames, of scale 1 unless there is one
/// camera.
class SimilarityEstimator {
 public:
  using Model = TwoWaySimilarity;
  static constexpr int kSampleSize = 3;

  /// @param rig  outlives the estimator
  /// @param matches  of view a; both corners of each have depth
  SimilarityEstimator(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                      std::span<const CornerMatch> matches, const VerificationOptions& options);

  [[nodiscard]] int size() const { return static_cast<int>(pairs_.size()); }

  /// Which pairs of matches one motion of a known scale can explain: they keep their distance and turn alike.
  [[nodiscard]] AgreementGraph agreements() const;

  void fit(std::span<const int, 3> sample, std::vector<Model>& models) const;

  /// The larger of the errors in either view [squared pixels of the corner's level]; of outliers, one that
  /// makes them such.
  [[nodiscard]] double squared_residual(const Model& model, int i) const {
    const Pair& pair = pairs_[static_cast<std::size_t>(i)];
    if (!nearly_same_direction(pair.turn, model.turn, max_turn_)) return 2 * outlier_;
    const double in_b = squared_error(rig_, model.to_b(pair.x_a), pair.pixel_b, pair.per_pixel_b);
    if (in_b > outlier_) return in_b;
    return std::max(squared_error(rig_, model.to_a(pair.x_b), pair.pixel_a, pair.per_pixel_a), in_b);
  }

 private:
  /// Of a match, both points, each in the frame of its own view, and both measurements.
  struct Pair {
    Vector3 x_a, x_b;
    StereoPixelF pixel_a, pixel_b;
    double per_pixel_a = 1, per_pixel_b = 1;
    double turn = 0;  ///< of the corner, from a to b
  };

  [[nodiscard]] bool as_long(double squared_a, double squared_b) const {
    return squared_a >= shortest_ * squared_b && squared_b >= shortest_ * squared_a;
  }
  [[nodiscard]] bool turn_alike(const Pair& i, const Pair& j) const {
    return nearly_same_direction(i.turn, j.turn, 2 * max_turn_);
  }

  const Rig& rig_;
  double shortest_;  ///< side over the longer of the two, squared
  double max_turn_;
  double outlier_;
  std::vector<Pair> pairs_;
};

}  // namespace twofold
