#pragma once

#include <string>
#include <vector>

#include "experiments/double_window/relative_error.hpp"
#include "experiments/double_window/scale_consistency.hpp"
#include "experiments/report.hpp"
#include "mapping/mapper.hpp"

namespace twofold::bench {

/// What a method did with one keyframe, and how good its map was then.
struct Round {
  EdgeErrorSum inner, both, all;      ///< edges within W1, within W1 and W2, all
  ScaleChange both_scale, all_scale;  ///< see record_scale
  double shape = 0;                   ///< shape_error of the whole map [m]; see record_scale
  double cpu_ms = 0;                  ///< of the mapper's round, processor time of its thread
  double frames = 0, points = 0, observations = 0, constraints = 0;  ///< in the optimisation
};
using Rounds = std::vector<Round>;  ///< by keyframe

/// All trials of one method.
struct MethodRounds {
  std::string name;
  std::vector<Rounds> trials;

  [[nodiscard]] std::size_t keyframes() const { return trials.front().size(); }
  /// Eq. 6.10 over all trials and the keyframes [first, last).
  [[nodiscard]] EdgeErrorSum error(EdgeErrorSum Round::*level, std::size_t first, std::size_t last) const;
  [[nodiscard]] ScaleChange scale(ScaleChange Round::*level, std::size_t first, std::size_t last) const;
  /// Median of a figure over all trials and the keyframes [first, last).
  [[nodiscard]] double median(double Round::*figure, std::size_t first, std::size_t last) const;
  [[nodiscard]] std::vector<double> rmse_curve(EdgeErrorSum Round::*level) const;
  [[nodiscard]] std::vector<double> median_curve(double Round::*figure) const;
};

/// Processor time of the calling thread [ms].
[[nodiscard]] double thread_cpu_ms();

/// Size and cost of a mapper's round.
void record_cost(const MapperReport& report, double cpu_ms, Round& round);
/// Errors by the same edges for all methods: those between members of the given window, which is one
/// method's.
void record_errors(const GraphSnapshot& graph, double metres_per_unit, const Scene& scene,
                   const DoubleWindow& window, Round& round);
/// How even the scale is within the window and in the whole map, and the shape of that.
void record_scale(const GraphSnapshot& graph, const Scene& scene, const DoubleWindow& window, Round& round);

/// NAME.csv with all curves, NAME_accuracy.png (three levels), NAME_cost.png (cost and problem sizes).
void write_rounds(const std::string& name, const std::string& title, const std::vector<MethodRounds>& methods,
                  bool scale_free, Report& report);

}  // namespace twofold::bench
