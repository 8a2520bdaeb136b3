#include "apps/twofold/view/run_frames.hpp"

#include <algorithm>
#include <array>
#include <fstream>
#include <set>
#include <span>
#include <sstream>
#include <string_view>

#include <fmt/format.h>

#include "base/median.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

constexpr std::array<std::string_view, 4> kStates{"tracked", "lost", "dropped", "placed_later"};

/// A usual interval of the poses [ns]; 1 if there is none.
std::int64_t usual_interval(const Trajectory& poses) {
  std::vector<std::int64_t> intervals;
  for (std::size_t i = 1; i < poses.size(); ++i) intervals.push_back(poses[i].t_ns - poses[i - 1].t_ns);
  return std::max<std::int64_t>(1, median(std::span(intervals)));
}

/// Of frames [begin, end), which nobody knows: between those before and after, or at the usual interval.
void fill_times(std::vector<RunFrame>& frames, std::size_t begin, std::size_t end, std::int64_t interval) {
  const auto gaps = static_cast<std::int64_t>(end - begin) + 1;
  for (std::size_t i = begin; i < end; ++i) {
    const auto n = static_cast<std::int64_t>(i - begin) + 1;
    if (begin > 0 && end < frames.size()) {
      frames[i].t_ns = frames[begin - 1].t_ns + (frames[end].t_ns - frames[begin - 1].t_ns) / gaps * n;
    } else if (begin > 0) {
      frames[i].t_ns = frames[begin - 1].t_ns + n * interval;
    } else {
      frames[i].t_ns = frames[end].t_ns - (gaps - n) * interval;
    }
  }
}

}  // namespace

void write_run_frames(const std::filesystem::path& file, const RunResult& result, bool kept_pace) {
  std::ofstream out(file);
  out << "# frame, time stamp [ns], state, exposure to pose [ms], tracking [ms], effort level\n";
  for (const FrameRecord& record : result.frames) {
    const auto ms = [](std::int64_t ns) { return 1e-6 * static_cast<double>(ns); };
    out << fmt::format("{} {} {} {:.3f} {:.3f} {}\n", record.frame_index, record.t_ns,
                       kStates[static_cast<std::size_t>(record.state)],
                       kept_pace ? ms(record.latency_ns) : 0.0, ms(record.tracking_ns),
                       static_cast<int>(record.effort));
  }
  out.close();
  if (!out) throw WriteError(file.string(), "cannot be written");
}

std::vector<RunFrame> read_run_frames(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw IoError(file.string(), "cannot be opened");
  std::vector<RunFrame> frames;
  std::string line, state;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    RunFrame frame;
    int effort = 0;
    words >> frame.number >> frame.t_ns >> state >> frame.latency_ms >> frame.tracking_ms >> effort;
    const auto known = std::find(kStates.begin(), kStates.end(), state);
    const bool grows =
        frames.empty() || (frame.number > frames.back().number && frame.t_ns > frames.back().t_ns);
    if (!words || known == kStates.end() || effort < 0 || effort > 255 || !grows)
      throw IoError(file.string(), fmt::format("line {} makes no sense", number));
    frame.state = static_cast<FrameState>(known - kStates.begin());
    frame.effort = static_cast<std::uint8_t>(effort);
    frames.push_back(frame);
  }
  return frames;
}

std::vector<RunFrame> counted_frames(const Trajectory& poses, const std::vector<std::uint32_t>& lost,
                                     const std::vector<std::uint32_t>& dropped) {
  const std::set<std::uint32_t> is_lost(lost.begin(), lost.end()), is_dropped(dropped.begin(), dropped.end());
  std::vector<RunFrame> frames;
  const std::int64_t interval = usual_interval(poses);
  std::size_t unknown = 0;  // frames from here on have no time yet
  for (std::size_t pose = 0;;) {
    RunFrame frame;
    frame.number = static_cast<std::uint32_t>(frames.size());
    if (is_lost.contains(frame.number)) {
      frame.state = FrameState::kLost;
    } else if (is_dropped.contains(frame.number)) {
      frame.state = FrameState::kDropped;
    } else if (pose == poses.size()) {
      break;
    } else {
      frame.t_ns = poses[pose++].t_ns;
    }
    frames.push_back(frame);
    if (frame.state != FrameState::kTracked) continue;
    fill_times(frames, unknown, frames.size() - 1, interval);
    unknown = frames.size();
  }
  if (unknown > 0) fill_times(frames, unknown, frames.size(), interval);
  return frames;
}

}  // namespace twofold
