#include "io/plots/latency_plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>

#include <fmt/format.h>

#include "io/plots/plot_ink.hpp"

namespace twofold {
namespace {

using namespace plot_ink;

constexpr int kPanelWidth = 380, kPanelHeight = 250, kPanelsARow = 3;              // [px] of the picture
constexpr int kLeft = 62, kRight = 16, kTop = 34, kBottom = 40, kHeaderLine = 20;  // [px]
constexpr double kLeastShare = 1e-4;
const std::array<cv::Scalar, 6> kColours{cv::Scalar(200, 90, 20), {60, 130, 240}, {90, 160, 60},
                                         {150, 60, 150},          {60, 60, 200},  {150, 150, 40}};

struct Panel {
  std::string title;
  std::vector<const StageTimes*> times;  // one a run; nullptr: it has none
};

/// nullptr when the run never passed the stage.
const StageTimes* find_times(const TimingFile& run, const std::string& thread, const std::string& stage) {
  const auto stages = run.threads.find(thread);
  if (stages == run.threads.end()) return nullptr;
  const auto found = stages->second.find(stage);
  return found == stages->second.end() || found->second.count == 0 ? nullptr : &found->second;
}

std::vector<Panel> panels_of(const std::vector<TimingFile>& runs) {
  std::set<std::pair<std::string, std::string>> names;
  for (const TimingFile& run : runs) {
    for (const auto& [thread, stages] : run.threads) {
      for (const auto& [stage, times] : stages) {
        if (times.count > 0) names.insert({thread, stage});
      }
    }
  }
  std::vector<Panel> panels;
  for (const auto& [thread, stage] : names) {
    Panel panel{thread + ": " + stage, {}};
    for (const TimingFile& run : runs) panel.times.push_back(find_times(run, thread, stage));
    panels.push_back(std::move(panel));
  }
  return panels;
}

/// Area inside one panel's axes, on the large canvas; both axes are decades.
struct LogAxes {
  cv::Rect inside;
  double first_decade = 0, last_decade = 1;  // of milliseconds

  [[nodiscard]] int x(double ms) const {
    const double at = (std::log10(std::max(ms, 1e-9)) - first_decade) / (last_decade - first_decade);
    return inside.x + static_cast<int>(std::lround(std::clamp(at, 0.0, 1.0) * inside.width));
  }
  [[nodiscard]] int y(double share) const {
    const double at = std::log10(std::max(share, kLeastShare)) / std::log10(kLeastShare);
    return inside.y + static_cast<int>(std::lround(at * inside.height));
  }
};

LogAxes fit_axes(const Panel& panel, cv::Point corner) {
  LogAxes axes;
  axes.inside = {corner.x + kSuper * kLeft, corner.y + kSuper * kTop, kSuper * (kPanelWidth - kLeft - kRight),
                 kSuper * (kPanelHeight - kTop - kBottom)};
  double least = 1e9, most = 0;
  for (const StageTimes* times : panel.times) {
    if (times == nullptr) continue;
    least = std::min(least, times->p50_ms / 4);  // what is faster than that need not be seen
    most = std::max(most, times->max_ms);
  }
  axes.first_decade = std::floor(std::log10(std::max(least, 1e-5)));
  axes.last_decade = std::max(std::ceil(std::log10(std::max(most, 1e-5))), axes.first_decade + 1);
  return axes;
}

void draw_axes(cv::Mat& canvas, const LogAxes& axes, const std::string& title) {
  const cv::Rect& in = axes.inside;
  for (double decade = axes.first_decade; decade <= axes.last_decade; ++decade) {
    const double ms = std::pow(10, decade);
    cv::line(canvas, {axes.x(ms), in.y}, {axes.x(ms), in.y + in.height}, kGrid, kSuper);
    put_text(canvas, fmt::format("{:g}", ms), {axes.x(ms), in.y + in.height + kSuper * 15}, 0.36,
             Anchor::kCentre);
  }
  for (const double share : {1.0, 0.1, 0.01, 0.001, kLeastShare}) {
    cv::line(canvas, {in.x, axes.y(share)}, {in.x + in.width, axes.y(share)}, kGrid, kSuper);
    put_text(canvas, fmt::format("{:g} %", 100 * share), {in.x - kSuper * 6, axes.y(share) + kSuper * 4},
             0.36, Anchor::kRight);
  }
  cv::rectangle(canvas, in, kInk, kSuper);
  put_text(canvas, title, {in.x, in.y - kSuper * 8}, 0.42, Anchor::kLeft, {20, 20, 20});
  put_text(canvas, "longer than [ms]", {in.x + in.width, in.y + in.height + kSuper * 31}, 0.36,
           Anchor::kRight);
}

/// A staircase: the share falls at the end of each bucket, and to nothing at the maximum.
void draw_curve(cv::Mat& canvas, const LogAxes& axes, const StageTimes& times, const cv::Scalar& colour) {
  std::uint64_t left = times.count;
  cv::Point at(axes.x(times.min_ms), axes.y(1));
  const auto go = [&](cv::Point to) {
    cv::line(canvas, at, to, colour, 2 * kSuper, cv::LINE_AA);
    at = to;
  };
  for (const TimingBucket& bucket : times.buckets) {
    left -= bucket.count;
    go({axes.x(std::min(1e-3 * bucket.to_us, times.max_ms)), at.y});
    go({at.x, axes.y(static_cast<double>(left) / static_cast<double>(times.count))});
  }
}

}  // namespace

cv::Mat draw_latencies(const std::vector<TimingFile>& runs) {
  const std::vector<Panel> panels = panels_of(runs);
  const int columns = std::clamp(static_cast<int>(panels.size()), 1, kPanelsARow);
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  const int header = kHeaderLine * (static_cast<int>(runs.size()) + 1);
  cv::Mat canvas(kSuper * (header + std::max(rows, 1) * kPanelHeight), kSuper * columns * kPanelWidth,
                 CV_8UC3, kWhite);
  for (std::size_t n = 0; n < runs.size(); ++n) {
    const int y = kSuper * kHeaderLine * (static_cast<int>(n) + 1);
    const cv::Scalar& colour = kColours[n % kColours.size()];
    cv::line(canvas, {kSuper * 20, y - kSuper * 4}, {kSuper * 46, y - kSuper * 4}, colour, 3 * kSuper,
             cv::LINE_AA);
    put_text(canvas, runs[n].name, {kSuper * 54, y}, 0.42, Anchor::kLeft);
  }
  for (std::size_t p = 0; p < panels.size(); ++p) {
    const int column = static_cast<int>(p) % columns, row = static_cast<int>(p) / columns;
    const LogAxes axes =
        fit_axes(panels[p], {kSuper * column * kPanelWidth, kSuper * (header + row * kPanelHeight)});
    draw_axes(canvas, axes, panels[p].title);
    for (std::size_t n = 0; n < runs.size(); ++n) {
      if (panels[p].times[n] != nullptr)
        draw_curve(canvas, axes, *panels[p].times[n], kColours[n % kColours.size()]);
    }
  }
  return shrink(canvas);
}

}  // namespace twofold
