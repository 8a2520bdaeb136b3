#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "apps/twofold/live_view.hpp"
#include "apps/twofold/map_options.hpp"
#include "apps/twofold/surface/live_surface.hpp"
#include "engine/options.hpp"

namespace twofold {

/// What `twofold run` is told on its command line.
struct RunArguments {
  std::string source;
  std::string calibration;
  std::string camera = "all";
  std::string out = "out/run";
  std::string speed = "max";
  std::string late;  // empty: as the source wants it
  std::string windows = "25,175";
  std::string replay_schedule;
  std::string trace;
  std::string pin;
  std::string vocabulary;
  std::string record;
  std::vector<std::string> poses;
  std::string poses_form = "json";
  std::string estimator = "engine";
  int window = 10;
  MapArguments map;
  ViewArguments view;
  LiveSurfaceArguments surface;
  bool no_metric_loops = false;
  bool no_places = false;
  bool deterministic = false;
  bool preload = false;
  bool real_time = false;
  bool quiet = false;
};

void add_run_options(CLI::App& command, RunArguments& arguments);

/// Refuses (IoError) each option that --estimator swf, the filter alone, does nothing for.
void expect_options_of_filter(const RunArguments& arguments);

/// Checks what the command line's own parser does not; IoError names the option. Maps are added by
/// apply_map_options.
[[nodiscard]] EngineOptions engine_options(const RunArguments& arguments);

}  // namespace twofold
