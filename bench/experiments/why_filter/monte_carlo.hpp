#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "experiments/report.hpp"
#include "experiments/why_filter/settings.hpp"

namespace twofold::bench {

/// What the trials with M frames and N points showed.
struct Cell {
  int trials = 0, failures = 0;  ///< failures: no finite result, or an error above half the motion
  double rmse = 0;               ///< over all finite results [m]
  double log2_det = 0;           ///< of the error's sample covariance
  double joint = 0, total = 0;   ///< mean [s]
};

using Grid = std::map<std::pair<int, int>, Cell>;  ///< by (M, N)
enum Method : int { kBa = 0, kFilter = 1 };

inline const char* method_name(int method) {
  return method == kBa ? "BA" : "filter";
}

/// One setting seen by one kind of camera.
struct Case {
  Setting setting;
  SensorKind kind;
  Grid grids[2];
  std::pair<int, int> base;  ///< <M_min, 15>, or the first cell without failures

  void find_base() {
    base = grids[kBa].begin()->first;
    for (const auto& [at, cell] : grids[kBa]) {
      if (at.second != 15 || !robust(at)) continue;
      base = at;
      break;
    }
  }
  [[nodiscard]] std::string name() const {
    return setting_name(setting) + (kind == SensorKind::kMono ? "_mono" : "_stereo");
  }
  [[nodiscard]] double entropy(int method, std::pair<int, int> at) const {
    return 0.5 * (grids[kBa].at(base).log2_det - grids[method].at(at).log2_det);
  }
  /// Cells too fragile to compare, as in the thesis: failures in either method.
  [[nodiscard]] bool robust(std::pair<int, int> at) const {
    return grids[kBa].at(at).failures == 0 && grids[kFilter].at(at).failures == 0;
  }
};

/// Figures 4.6 - 4.9, 4.12 as CSV and as plots.
void write_case(const Case& c, Report& report);
void plot_case(const Case& c, Report& report);
/// What the thesis says of them, beside what they show.
void state_results(const std::vector<Case>& cases, Report& report);

}  // namespace twofold::bench
