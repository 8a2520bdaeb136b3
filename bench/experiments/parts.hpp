#pragma once

#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "experiments/report.hpp"

namespace twofold::bench {

/// The parts of an experiment program, by the name that --only has for them.
template <class Options>
using Parts = std::vector<std::pair<std::string, std::function<void(const Options&, Report&)>>>;

/// Runs the parts that `only` names, all if it names none, and says when each is done.
template <class Options>
void run_parts(const Parts<Options>& parts, const std::vector<std::string>& only, const Options& options,
               Report& report) {
  for (const auto& [name, experiment] : parts) {
    if (!only.empty() && std::find(only.begin(), only.end(), name) == only.end()) continue;
    experiment(options, report);
    std::printf("done: %s\n", name.c_str());
    std::fflush(stdout);
  }
}

}  // namespace twofold::bench
