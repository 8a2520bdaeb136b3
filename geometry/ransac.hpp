#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/option_check.hpp"

namespace twofold {

/// SplitMix64 (Steele et al., OOPSLA 2014): the same numbers on every platform, unlike <random>'s
/// distributions.
class SplitMix64 {
 public:
  explicit SplitMix64(std::uint64_t seed) : state_(seed) {}
  [[nodiscard]] std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  }
  /// In [0, n), n in [1, 2^31); the bias is below 2^-32.
  [[nodiscard]] int below(int n) {
    return static_cast<int>(((next() >> 32) * static_cast<std::uint64_t>(n)) >> 32);
  }

 private:
  std::uint64_t state_;
};

struct RansacOptions {
  double threshold =
      0;  ///< largest residual of an inlier, in the unit of Estimator::squared_residual's root, > 0
  double confidence = 0.999;  ///< probability of having drawn one sample without outliers, in (0, 1)
  int max_iterations = 1000;  ///< samples, >= 1
  std::uint64_t seed = 1;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const {
    return OptionCheck()
        .above("threshold", threshold, 0)
        .that(confidence > 0 && confidence < 1, "confidence", "in (0, 1)", confidence)
        .at_least("max_iterations", max_iterations, 1)
        .reason();
  }
};

template <class Model>
struct RansacResult {
  Model model;
  std::vector<int> inliers;  ///< ascending indices of data with residual <= threshold under model
  int iterations = 0;        ///< samples drawn
};

/// Best model seen by RANSAC, and how many data agree with it.
template <class Model>
struct BestModel {
  Model model;
  int inliers = 0;
  double score = 0;    ///< the lower the better
  int iterations = 0;  ///< samples drawn
};

/// How well a model explains the data: by the truncated quadratic score of MSAC (Torr & Zisserman, 2000),
/// which prefers, among models with the same inliers, the one that fits them better.
struct ModelScore {
  double score = 0;  ///< sum of the squared residuals, each cut off at the squared threshold
  int inliers = 0;
};

/// @param enough  a score from which on nobody wants to know: it may be that of a part of the data then
template <class Estimator>
ModelScore score_of(const Estimator& estimator, const typename Estimator::Model& model, double threshold2,
                    double enough) {
  if constexpr (requires { estimator.score(model, threshold2, enough); }) {
    return estimator.score(model, threshold2, enough);
  } else {
    ModelScore sum;
    for (int i = 0; i < estimator.size() && sum.score < enough; ++i) {
      const double r2 = estimator.squared_residual(model, i);
      if (r2 <= threshold2) ++sum.inliers;
      sum.score += r2 <= threshold2 ? r2 : threshold2;
    }
    return sum;
  }
}

/// Fits models to a sample; the best of them takes the place of `best` if it has the better score. It must
/// have as many inliers as a sample has data.
///
/// Estimator:
///   using Model;  static constexpr int kSampleSize;
///   int size() const;                                                          number of data
///   void fit(std::span<const int, kSampleSize>, std::vector<Model>&) const;    appends none or some models
///   double squared_residual(const Model&, int i) const;                        may be infinite
/// or, instead of the last, all data at once:
///   ModelScore score(const Model&, double threshold2, double enough) const;    as score_of
///
/// @param models  scratch: with room for what one sample yields, nothing is allocated
/// @return  whether one was better
template <class Estimator>
bool try_sample(const Estimator& estimator, std::span<const int, Estimator::kSampleSize> sample,
                double threshold, std::vector<typename Estimator::Model>& models,
                std::optional<BestModel<typename Estimator::Model>>& best) {
  const double threshold2 = threshold * threshold;
  double best_score = best ? best->score : std::numeric_limits<double>::infinity();
  bool better = false;
  models.clear();
  estimator.fit(sample, models);
  for (const auto& model : models) {
    const auto [score, inliers] = score_of(estimator, model, threshold2, best_score);
    if (score >= best_score || inliers < Estimator::kSampleSize) continue;
    best_score = score;
    best = {model, inliers, score};
    better = true;
  }
  return better;
}

/// Adaptive RANSAC (Fischler & Bolles, CACM 1981): draws samples until one without outliers was among them
/// with the probability asked for.
///
/// @param models  scratch, as for try_sample
/// @return  the best model seen, not refined; nullopt when size() < kSampleSize or no model has kSampleSize
/// inliers. Deterministic: depends on the estimator and the options only.
template <class Estimator>
[[nodiscard]] std::optional<BestModel<typename Estimator::Model>> best_model(
    const Estimator& estimator, const RansacOptions& options,
    std::vector<typename Estimator::Model>& models) {
  constexpr int kSample = Estimator::kSampleSize;
  const int n = estimator.size();
  if (n < kSample) return std::nullopt;
  SplitMix64 random(options.seed);
  std::optional<BestModel<typename Estimator::Model>> best;
  int needed = options.max_iterations;
  int iteration = 0;
  for (; iteration < needed; ++iteration) {
    std::array<int, kSample> sample;
    for (int k = 0; k < kSample; ++k) {
      do {
        sample[k] = random.below(n);
      } while (std::find(sample.begin(), sample.begin() + k, sample[k]) != sample.begin() + k);
    }
    if (!try_sample(estimator, std::span<const int, kSample>(sample), options.threshold, models, best))
      continue;
    // 1 - (1 - w^k)^N >= confidence, w the inlier share
    const double p_good = std::pow(static_cast<double>(best->inliers) / n, kSample);
    const double draws = p_good >= 1 ? 1 : std::log(1 - options.confidence) / std::log1p(-p_good);
    needed = draws < options.max_iterations ? std::max(1, static_cast<int>(std::ceil(draws)))
                                            : options.max_iterations;
  }
  if (best) best->iterations = iteration;
  return best;
}

/// The best model, with the data that agree with it.
template <class Estimator>
[[nodiscard]] std::optional<RansacResult<typename Estimator::Model>> with_inliers(
    const Estimator& estimator, const std::optional<BestModel<typename Estimator::Model>>& best,
    double threshold) {
  if (!best) return std::nullopt;
  RansacResult<typename Estimator::Model> result{best->model, {}, best->iterations};
  for (int i = 0; i < estimator.size(); ++i) {
    if (estimator.squared_residual(best->model, i) <= threshold * threshold) result.inliers.push_back(i);
  }
  return result;
}

/// best_model, with the data that agree with it.
template <class Estimator>
[[nodiscard]] std::optional<RansacResult<typename Estimator::Model>> ransac(const Estimator& estimator,
                                                                            const RansacOptions& options) {
  std::vector<typename Estimator::Model> models;
  return with_inliers(estimator, best_model(estimator, options, models), options.threshold);
}

/// What RANSAC would find if it drew these samples, each of them once.
template <class Estimator>
[[nodiscard]] std::optional<RansacResult<typename Estimator::Model>> best_of_samples(
    const Estimator& estimator, std::span<const std::array<int, Estimator::kSampleSize>> samples,
    double threshold) {
  std::vector<typename Estimator::Model> models;
  std::optional<BestModel<typename Estimator::Model>> best;
  for (const auto& sample : samples) try_sample(estimator, std::span(sample), threshold, models, best);
  return with_inliers(estimator, best, threshold);
}

}  // namespace twofold
