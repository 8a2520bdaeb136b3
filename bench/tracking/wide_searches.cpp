#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <exception>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <vector>

#include <fmt/core.h>

#include "base/processor_time.hpp"
#include "imaging/image_buffers.hpp"
#include "io/sources/open_source.hpp"
#include "tracking/loss/wide_search.hpp"

// The wider search alone: each frame of a recording is compared with the frames before it, all of them, as a
// lost camera's is in the worst case. What that takes, and how often the motion is found and is the true one.

namespace twofold {
namespace {

constexpr std::size_t kViews = 5;  // the last frame and four keyframes

struct Arguments {
  std::string source;
  SourceOptions options;
  int every = 1;                        ///< frames from one that is taken to the next
  int repeat = 3;                       ///< the least time counts
  double within = 0.1, within_deg = 2;  ///< of the truth [m, degrees]: right
  bool verbose = false;
};

struct View {
  FrameImages images;
  FrameCorners corners;
  std::optional<SE3> T_w_c;  ///< the truth
};

/// Adds up the processor time of calls.
template <class Work>
void add_ms(double& sum, const Work& work) {
  const std::int64_t start = thread_cpu_ns();
  work();
  sum += 1e-6 * static_cast<double>(thread_cpu_ns() - start);
}

/// Of pairs of frames so many frames apart.
struct Findings {
  int pairs = 0, found = 0, judged = 0, right = 0;
  std::vector<double> off_mm;  ///< of those that are right
};

struct Times {
  std::vector<double> look, describe, find, frame;  ///< [ms]
};

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

void judge(const std::optional<SE3>& found, const View& earlier, const View& now, const Arguments& arguments,
           Findings& findings) {
  ++findings.pairs;
  findings.found += found.has_value();
  if (!found || !earlier.T_w_c || !now.T_w_c) return;
  ++findings.judged;
  const SE3 error = *found * (now.T_w_c->inverse() * *earlier.T_w_c).inverse();
  const double off = error.translation().norm();
  if (off > arguments.within || error.so3().log().norm() * 180 / std::numbers::pi > arguments.within_deg)
    return;
  ++findings.right;
  findings.off_mm.push_back(1e3 * off);
}

/// What one comparison with all views took, least of several [ms].
struct FrameTimes {
  double look = 0;
  std::array<double, kViews> describe{}, find{};

  [[nodiscard]] FrameTimes least(const FrameTimes& other) const {
    FrameTimes result;
    result.look = std::min(look, other.look);
    for (std::size_t age = 0; age < kViews; ++age) {
      result.describe[age] = std::min(describe[age], other.describe[age]);
      result.find[age] = std::min(find[age], other.find[age]);
    }
    return result;
  }
};

/// Nothing is known of the views: a frame's time is that of the first one that needs them all.
void compare(const std::vector<std::unique_ptr<View>>& views, std::size_t now, WideSearch& search,
             const Arguments& arguments, Times& times, std::array<Findings, kViews>& findings) {
  const std::size_t count = std::min(now, kViews);
  std::array<std::optional<SE3>, kViews> found;
  FrameTimes least;
  for (int n = 0; n < arguments.repeat; ++n) {
    FrameTimes taken;
    add_ms(taken.look, [&] { search.look_at(views[now]->images); });
    for (std::size_t age = 0; age < count; ++age) {
      View& view = *views[now - 1 - age];
      view.corners.clear();
      add_ms(taken.describe[age], [&] { search.describe(view.images, view.corners); });
      add_ms(taken.find[age], [&] { found[age] = search.find(view.images, view.corners, {}); });
    }
    least = n == 0 ? taken : least.least(taken);
  }
  times.look.push_back(least.look);
  for (std::size_t age = 0; age < count; ++age) {
    times.describe.push_back(least.describe[age]);
    times.find.push_back(least.find[age]);
    judge(found[age], *views[now - 1 - age], *views[now], arguments, findings[age]);
    if (arguments.verbose) fmt::print("{} {} {}\n", now, age + 1, found[age] ? "found" : "-");
  }
  if (count < kViews) return;
  times.frame.push_back(least.look + std::accumulate(least.describe.begin(), least.describe.end(), 0.0) +
                        std::accumulate(least.find.begin(), least.find.end(), 0.0));
}

void print_times(const char* name, const std::vector<double>& ms) {
  fmt::print("{:30} median {:6.2f}  p90 {:6.2f}  max {:6.2f} ms\n", name, percentile(ms, 0.5),
             percentile(ms, 0.9), percentile(ms, 1));
}

std::vector<std::unique_ptr<View>> read_views(FrameSource& source, int every, const WideSearch& search) {
  std::vector<std::unique_ptr<View>> views;
  const Trajectory& truth = source.ground_truth();
  FrameStatus status{};
  for (Frame frame; (status = source.next(frame)) == FrameStatus::kFrame;) {
    if (frame.index % every != 0) continue;
    auto view = std::make_unique<View>();
    allocate_images(source.rig(), view->images);
    view->images.left.build(frame.left);
    if (!frame.right.empty()) view->images.right.build(frame.right);
    if (!frame.depth.empty()) frame.depth.copyTo(view->images.depth);
    search.prepare(view->corners);
    constexpr std::int64_t kSameNs = 20'000'000;
    for (const TimedPose& pose : truth) {
      if (std::abs(pose.t_ns - frame.t_ns) <= kSameNs) view->T_w_c = pose.T_w_c;
    }
    views.push_back(std::move(view));
  }
  if (status == FrameStatus::kError) throw std::runtime_error(source.error());
  return views;
}

void run(const Arguments& arguments) {
  const auto source = open_source(arguments.source, arguments.options);
  WideSearch search(source->rig(), {});
  const auto views = read_views(*source, arguments.every, search);
  Times times;
  std::array<Findings, kViews> findings;
  for (std::size_t now = 1; now < views.size(); ++now)
    compare(views, now, search, arguments, times, findings);
  print_times("this frame's corners", times.look);
  print_times("an earlier one's", times.describe);
  print_times("match and find the motion", times.find);
  print_times("all of a frame, five views", times.frame);
  for (std::size_t age = 0; age < kViews; ++age) {
    const Findings& f = findings[age];
    fmt::print("{} before: {} pairs, {} found; {} of {} right, {:.1f} mm off in the median\n", age + 1,
               f.pairs, f.found, f.right, f.judged, percentile(f.off_mm, 0.5));
  }
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  twofold::Arguments arguments;
  std::string calibration;
  CLI::App app("The wider search alone: time, and how often it is right");
  app.add_option("source", arguments.source, "recording or scheme:ARGUMENT")->required();
  app.add_option("--calib", calibration, "calibration file");
  app.add_option("--every", arguments.every, "every so many frames only")->check(CLI::PositiveNumber);
  app.add_option("--repeat", arguments.repeat, "the least of so many times")->check(CLI::PositiveNumber);
  app.add_option("--within", arguments.within, "of the truth is right [m]");
  app.add_option("--within-deg", arguments.within_deg, "and within so much of its orientation");
  app.add_flag("-v,--verbose", arguments.verbose, "a line for every pair");
  CLI11_PARSE(app, argc, argv);
  if (!calibration.empty()) arguments.options.calibration = calibration;
  try {
    twofold::run(arguments);
  } catch (const std::exception& error) {
    fmt::print(stderr, "wide_searches: {}\n", error.what());
    return 1;
  }
  return 0;
}
