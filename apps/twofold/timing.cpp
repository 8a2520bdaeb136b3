#include <CLI/CLI.hpp>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "io/files/timing_file.hpp"
#include "io/plots/latency_plot.hpp"
#include "io/plots/plot.hpp"

namespace twofold {
namespace {

int show_timing(const std::vector<std::string>& files, const std::string& plot) {
  std::vector<TimingFile> runs;
  runs.reserve(files.size());
  for (const std::string& file : files) runs.push_back(read_timing(file));
  fmt::print("{}", timing_table(runs));
  if (!plot.empty()) {
    write_png(plot, draw_latencies(runs));
    fmt::print("plot in {}\n", plot);
  }
  return kOk;
}

}  // namespace

void add_timing_command(CLI::App& app, int& exit_code) {
  auto files = std::make_shared<std::vector<std::string>>();
  auto plot = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("timing", "Print and compare where runs spent their time");
  command->add_option("FILE", *files, "timing.json of a run, or the run's folder; the first is the base")
      ->required();
  command->add_option("--plot", *plot, "Picture of all latency distributions (PNG)");
  command->callback([files, plot, &exit_code] { exit_code = show_timing(*files, *plot); });
}

}  // namespace twofold
