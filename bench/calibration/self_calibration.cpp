#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "io/sources/open_source.hpp"
#include "selfcalibration/clip_collector.hpp"
#include "selfcalibration/self_calibration.hpp"

// The focal length of a recording from itself, against the one of its calibration.

int main(int argc, char** argv) {
  using namespace twofold;
  std::string text;
  double truth = 0, from = 0, seconds = 20;
  CLI::App app("Focal length from a video itself");
  app.add_option("SOURCE", text)->required();
  app.add_option("--truth", truth, "[px]");
  app.add_option("--from", from, "[s]");
  app.add_option("--seconds", seconds, "[s]");
  CLI11_PARSE(app, argc, argv);
  SourceOptions options;
  options.left_only = true;
  const auto source = open_source(text, options);
  const PinholeCamera& camera = source->rig().camera;
  ClipCollector collector(camera.width, camera.height);
  Frame frame;
  std::int64_t first = -1;
  const auto t0 = std::chrono::steady_clock::now();
  while (source->next(frame) == FrameStatus::kFrame) {
    if (first < 0) first = frame.t_ns;
    const double t = static_cast<double>(frame.t_ns - first) * 1e-9;
    if (t < from) continue;
    if (t > from + seconds) break;
    collector.add_frame(frame.left, frame.t_ns);
  }
  collector.finish();
  const auto t1 = std::chrono::steady_clock::now();
  const auto result = self_calibrate(collector.clips(), camera.width, camera.height);
  const auto t2 = std::chrono::steady_clock::now();
  const auto ms = [](auto d) { return std::chrono::duration<double, std::milli>(d).count(); };
  if (!result) {
    fmt::print("{}: refused: {}\n", text, result.error());
    return 1;
  }
  const auto& l = result->lens;
  const auto& s = result->sigma;
  fmt::print("{}\n  {} clips, corners {:.2f} px, f {:.1f} +- {:.1f} px (statistics {:.2f} %, {:.3f} widths)",
             text, result->clips, result->corner_sigma_px, l.f(), result->f_sigma, 100 * s[0],
             l.f() / camera.width);
  if (truth > 0)
    fmt::print("  truth {:.1f} error {:.2f} % z {:.2f}", truth, 100 * (l.f() / truth - 1),
               (l.f() - truth) / result->f_sigma);
  fmt::print(
      "\n  k1 {:.3f}+-{:.3f} k2 {:.3f}+-{:.3f} c {:.1f},{:.1f}+-{:.1f},{:.1f} readout {:.1f}+-{:.1f} ms; "
      "{:.0f} + {:.0f} ms\n",
      l.k1, s[1], l.k2, s[2], l.centre.x(), l.centre.y(), s[3], s[4], 1e3 * l.readout, 1e3 * s[5],
      ms(t1 - t0), ms(t2 - t1));
  return 0;
}
