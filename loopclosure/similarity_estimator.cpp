#include "loopclosure/similarity_estimator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/angles.hpp"
#include "geometry/absolute_orientation.hpp"

namespace twofold {

SimilarityEstimator::SimilarityEstimator(const Rig& rig, const PlaceAppearance& a, const PlaceAppearance& b,
                                         std::span<const CornerMatch> matches,
                                         const VerificationOptions& options)
    : rig_(rig),
      shortest_(std::pow(std::max(0.0, 1 - options.max_stretch), 2)),
      max_turn_(options.max_turn_deg * kDegree),
      outlier_(options.ransac_error_px * options.ransac_error_px) {
  for (const CornerMatch& match : matches) {
    const auto i = static_cast<std::size_t>(match.corner);
    const auto j = static_cast<std::size_t>(match.b);
    pairs_.push_back({match.x_a, rig.unproject(b.pixels[j].cast<double>()), a.pixels[i], b.pixels[j],
                      per_squared_pixel(a.corners[i].level), per_squared_pixel(b.corners[j].level),
                      double{b.corners[j].angle} - a.corners[i].angle});
  }
}

AgreementGraph SimilarityEstimator::agreements() const {
  AgreementGraph graph(pairs_.size());
  // All the later matches at once: this is done for every two of some hundred.
  Eigen::ArrayX3d x_a(size(), 3), x_b(size(), 3);
  Eigen::ArrayXd turn(size());
  for (int i = 0; i < size(); ++i) {
    const Pair& pair = pairs_[static_cast<std::size_t>(i)];
    x_a.row(i) = pair.x_a;
    x_b.row(i) = pair.x_b;
    turn[i] = pair.turn;
  }
  Eigen::Array<bool, Eigen::Dynamic, 1> agree;
  for (int i = 0; i < size(); ++i) {
    const int later = size() - i - 1;
    const auto squared_distances = [&](const Eigen::ArrayX3d& x) {
      const auto from_i = [&](int k) { return (x.col(k).tail(later) - x(i, k)).square(); };
      return (from_i(0) + from_i(1) + from_i(2)).eval();
    };
    const Eigen::ArrayXd in_a = squared_distances(x_a), in_b = squared_distances(x_b);
    const Eigen::ArrayXd rounds = (turn.tail(later) - turn[i]) / (2 * std::numbers::pi);
    agree = in_a >= shortest_ * in_b && in_b >= shortest_ * in_a &&
            (rounds - rounds.rint()).abs() <= max_turn_ / std::numbers::pi;
    for (int j = 0; j < later; ++j) {
      if (agree[j]) graph.join(static_cast<std::size_t>(i), static_cast<std::size_t>(i + 1 + j));
    }
  }
  return graph;
}

void SimilarityEstimator::fit(std::span<const int, 3> sample, std::vector<Model>& models) const {
  const auto pair_of = [&](std::size_t k) -> const Pair& {
    return pairs_[static_cast<std::size_t>(sample[k % 3])];
  };
  // Most samples fail, and most of them here already.
  for (std::size_t k = 0; k < 3; ++k) {
    if (!turn_alike(pair_of(k), pair_of(k + 1))) return;
  }
  const bool scale_known = rig_.kind != SensorKind::kMono;
  std::array<Vector3, 3> x_a, x_b;
  double scale = 1;  // of the first side, squared
  for (std::size_t k = 0; k < 3; ++k) {
    const Pair &pair = pair_of(k), &next = pair_of(k + 1);
    x_a[k] = pair.x_a;
    x_b[k] = pair.x_b;
    const double in_b = (pair.x_b - next.x_b).squaredNorm();
    double in_a = (pair.x_a - next.x_a).squaredNorm();
    if (!scale_known && k == 0) scale = in_b / in_a;
    in_a *= scale;
    if (!as_long(in_a, in_b)) return;
  }
  if (scale_known) {
    if (const auto T_b_a = align_rigid(x_b, x_a)) models.emplace_back(Sim3(*T_b_a));
  } else if (const auto S_b_a = align_similarity(x_b, x_a)) {
    models.emplace_back(*S_b_a);
  }
}

}  // namespace twofold
