#include "io/plots/plot.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "io/files/output_file.hpp"
#include "io/plots/plot_ink.hpp"

namespace twofold {
namespace {

using namespace plot_ink;

constexpr int kLeftMargin = 90, kRightMargin = 40, kTopMargin = 90, kBottomMargin = 78,
              kBarMargin = 110;  // [px]

/// Maps the plane of the paper (a to the right, b up, metres) to pixels of the large canvas.
struct Axes {
  Vector2 min = Vector2::Zero(), max = Vector2::Zero();
  double scale = 1;  ///< canvas pixels a metre
  cv::Point origin;  ///< lower left corner of the area inside the axes
  cv::Size inside;   ///< its size in canvas pixels

  [[nodiscard]] cv::Point pixel(const Vector2& p) const {
    return {origin.x + static_cast<int>(std::lround((p.x() - min.x()) * scale)),
            origin.y - static_cast<int>(std::lround((p.y() - min.y()) * scale))};
  }
};

/// The two world axes on the paper when looking along `up`.
std::pair<int, int> paper_axes(int up) {
  return up == 0 ? std::pair(1, 2) : up == 1 ? std::pair(0, 2) : std::pair(0, 1);
}

Axes fit_axes(const std::vector<PlotTrack>& tracks, const PlotOptions& options) {
  const auto [a, b] = paper_axes(options.up_axis);
  Axes axes;
  bool any = false;
  for (const PlotTrack& track : tracks) {
    for (const Vector3& x : track.x_w) {
      const Vector2 p(x[a], x[b]);
      axes.min = any ? axes.min.cwiseMin(p) : p;
      axes.max = any ? axes.max.cwiseMax(p) : p;
      any = true;
    }
  }
  const double extent = std::max((axes.max - axes.min).maxCoeff(), 1e-3);
  const Vector2 middle = 0.5 * (axes.min + axes.max);
  // A straight road would give a strip too thin to read: show at least 45 % of the long side on the short
  // one.
  const Vector2 half =
      (0.5 * (axes.max - axes.min)).cwiseMax(0.225 * extent) + Vector2::Constant(0.06 * extent);
  axes.min = middle - half;
  axes.max = middle + half;
  axes.scale = kSuper * options.long_side / (2 * half.maxCoeff());
  axes.inside = {static_cast<int>(2 * half.x() * axes.scale), static_cast<int>(2 * half.y() * axes.scale)};
  axes.origin = {kSuper * kLeftMargin, kSuper * kTopMargin + axes.inside.height};
  return axes;
}

/// 1, 2 or 5 times a power of ten, giving about six intervals.
double tick_step(double range) {
  const double raw = range / 6;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) return factor * power;
  }
  return 10 * power;
}

std::string tick_text(double value, double step) {
  const int decimals = std::max(0, static_cast<int>(std::ceil(-std::log10(step) - 1e-9)));
  return fmt::format("{:.{}f}", std::abs(value) < 0.01 * step ? 0.0 : value, decimals);
}

void draw_grid(cv::Mat& canvas, const Axes& axes, const PlotOptions& options) {
  const auto [a, b] = paper_axes(options.up_axis);
  const char* const unit = options.metric ? " [m]" : "";
  const cv::Point top_right(axes.origin.x + axes.inside.width, axes.origin.y - axes.inside.height);
  const double step = tick_step((axes.max - axes.min).maxCoeff());
  for (double v = std::ceil(axes.min.x() / step) * step; v <= axes.max.x(); v += step) {
    const int x = axes.pixel({v, axes.min.y()}).x;
    cv::line(canvas, {x, axes.origin.y}, {x, top_right.y}, kGrid, kSuper);
    put_text(canvas, tick_text(v, step), {x, axes.origin.y + kSuper * 22}, 0.45, Anchor::kCentre);
  }
  for (double v = std::ceil(axes.min.y() / step) * step; v <= axes.max.y(); v += step) {
    const int y = axes.pixel({axes.min.x(), v}).y;
    cv::line(canvas, {axes.origin.x, y}, {top_right.x, y}, kGrid, kSuper);
    put_text(canvas, tick_text(v, step), {axes.origin.x - kSuper * 10, y + kSuper * 5}, 0.45, Anchor::kRight);
  }
  cv::rectangle(canvas, {axes.origin.x, axes.origin.y}, top_right, kInk, kSuper);
  put_text(canvas, fmt::format("{}{}", "xyz"[a], unit),
           {axes.origin.x + axes.inside.width / 2, axes.origin.y + kSuper * 50}, 0.5, Anchor::kCentre);
  put_text(canvas, fmt::format("{}{}", "xyz"[b], unit),
           {kSuper * 12, axes.origin.y - axes.inside.height - kSuper * 12}, 0.5, Anchor::kLeft);
}

/// Colours from blue (low) over green to red (high), 256 rows.
cv::Mat colour_scale() {
  cv::Mat grey(256, 1, CV_8UC1), colours;
  for (int i = 0; i < 256; ++i) grey.at<unsigned char>(i) = static_cast<unsigned char>(i);
  cv::applyColorMap(grey, colours, cv::COLORMAP_TURBO);
  return colours;
}

double largest(const std::vector<double>& values) {
  return std::max(1e-12, *std::max_element(values.begin(), values.end()));
}

void draw_track(cv::Mat& canvas, const Axes& axes, const PlotTrack& track, int up_axis) {
  const auto [a, b] = paper_axes(up_axis);
  const bool by_value = track.values.size() == track.x_w.size() && !track.values.empty();
  const cv::Mat colours = by_value ? colour_scale() : cv::Mat();
  const double top = by_value ? largest(track.values) : 1;
  const auto pixel = [&, a = a, b = b](std::size_t i) {
    return axes.pixel({track.x_w[i][a], track.x_w[i][b]});
  };
  for (std::size_t i = 1; i < track.x_w.size(); ++i) {
    cv::Scalar colour = track.bgr;
    if (by_value) {
      const auto c = colours.at<cv::Vec3b>(static_cast<int>(std::lround(255 * track.values[i] / top)));
      colour = cv::Scalar(c[0], c[1], c[2]);
    }
    cv::line(canvas, pixel(i - 1), pixel(i), colour, track.width_px * kSuper, cv::LINE_AA);
  }
  cv::circle(canvas, pixel(0), 6 * kSuper, kWhite, cv::FILLED, cv::LINE_AA);
  cv::circle(canvas, pixel(0), 6 * kSuper, track.bgr, 2 * kSuper, cv::LINE_AA);
  const cv::Point end = pixel(track.x_w.size() - 1), d(5 * kSuper, 5 * kSuper);
  cv::rectangle(canvas, end - d, end + d, track.bgr, cv::FILLED);
}

/// One row above the axes: a line and a name a track, then what the marks mean.
/// @return  where it ends, from the left
int draw_legend(cv::Mat& canvas, const Axes& axes, const std::vector<PlotTrack>& tracks) {
  int x = axes.origin.x + kSuper * 70;
  const int y = axes.origin.y - axes.inside.height - kSuper * 16;
  const auto advance = [&](const std::string& text) {
    int baseline = 0;
    put_text(canvas, text, {x, y + kSuper * 4}, 0.45, Anchor::kLeft);
    x +=
        cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, 0.45 * kSuper, kSuper, &baseline).width + kSuper * 22;
  };
  for (const PlotTrack& track : tracks) {
    if (track.x_w.empty()) continue;
    cv::line(canvas, {x, y}, {x + kSuper * 26, y}, track.bgr, (track.width_px + 1) * kSuper, cv::LINE_AA);
    x += kSuper * 34;
    advance(track.name);
  }
  cv::circle(canvas, {x, y}, 5 * kSuper, kInk, 2 * kSuper, cv::LINE_AA);
  x += kSuper * 12;
  advance("start");
  cv::rectangle(canvas, {x - 4 * kSuper, y - 4 * kSuper}, {x + 4 * kSuper, y + 4 * kSuper}, kInk, cv::FILLED);
  x += kSuper * 12;
  advance("end");
  return x;
}

void draw_colour_bar(cv::Mat& canvas, const Axes& axes, double top, const std::string& label) {
  const int x = axes.origin.x + axes.inside.width + kSuper * 26;
  const int width = kSuper * 16;
  const int height = axes.inside.height - kSuper * 30;
  cv::Mat bar;
  cv::flip(colour_scale(), bar, 0);
  cv::resize(bar, bar, {width, height}, 0, 0, cv::INTER_LINEAR);
  bar.copyTo(canvas(cv::Rect(x, axes.origin.y - height, width, height)));
  cv::rectangle(canvas, cv::Rect(x, axes.origin.y - height, width, height), kInk, kSuper);
  put_text(canvas, label, {x - kSuper * 10, axes.origin.y - height - kSuper * 12}, 0.45, Anchor::kLeft);
  const double step = tick_step(top);
  for (double v = 0; v <= top; v += step) {
    const int y = axes.origin.y - static_cast<int>(v / top * height);
    cv::line(canvas, {x + width, y}, {x + width + kSuper * 4, y}, kInk, kSuper);
    put_text(canvas, tick_text(v, step), {x + width + kSuper * 8, y + kSuper * 5}, 0.42, Anchor::kLeft);
  }
}

}  // namespace

int up_axis_of(const Trajectory& trajectory) {
  Vector3 down = Vector3::Zero();
  for (const TimedPose& pose : trajectory) down += pose.T_w_c.rotation().col(1);
  int axis = 2;
  if (!trajectory.empty()) down.cwiseAbs().maxCoeff(&axis);
  return axis;
}

std::string PlotOptions::invalid_reason() const {
  return OptionCheck().within("up_axis", up_axis, 0, 2).at_least("long_side", long_side, 1).reason();
}

cv::Mat draw_top_down(const std::vector<PlotTrack>& tracks, const PlotOptions& options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "plot options");
  const Axes axes = fit_axes(tracks, options);
  const auto coloured =
      std::find_if(tracks.begin(), tracks.end(), [](const auto& t) { return !t.values.empty(); });
  const bool has_bar = coloured != tracks.end();
  cv::Mat nowhere(1, 1, CV_8UC3);  // to know how wide the legend is
  const int width =
      std::max(draw_legend(nowhere, axes, tracks),
               axes.inside.width + kSuper * (kLeftMargin + (has_bar ? kBarMargin : kRightMargin)));
  const int height = axes.inside.height + kSuper * (kTopMargin + kBottomMargin);
  cv::Mat canvas(height, width, CV_8UC3, kWhite);
  draw_grid(canvas, axes, options);
  for (const PlotTrack& track : tracks) {
    if (!track.x_w.empty()) draw_track(canvas, axes, track, options.up_axis);
  }
  (void)draw_legend(canvas, axes, tracks);
  if (has_bar) draw_colour_bar(canvas, axes, largest(coloured->values), options.value_label);
  put_text(canvas, shortened(options.title, 0.7, width / kSuper - kLeftMargin - kRightMargin),
           {kSuper * kLeftMargin, kSuper * 32}, 0.7, Anchor::kLeft, {20, 20, 20}, 1);
  put_text(canvas, options.subtitle, {kSuper * kLeftMargin, kSuper * 54}, 0.45, Anchor::kLeft,
           {110, 110, 110});
  return shrink(canvas);
}

void write_png(const std::filesystem::path& file, const cv::Mat& image) {
  std::vector<unsigned char> bytes;
  cv::imencode(".png", image, bytes);
  write_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

std::vector<Vector3> positions(const Trajectory& trajectory) {
  std::vector<Vector3> x_w;
  for (const TimedPose& pose : trajectory) x_w.push_back(pose.T_w_c.translation());
  return x_w;
}

}  // namespace twofold
