// What it costs tracker and mapper that users hold maps: a rendered courtyard, round after round, for four
// engines at once: nobody holds a map of the first; a thread holds one of the second from its first round on
// (in short runs, from half of them on) to the end, and reads its keyframes and points again and again; a
// thread takes a thousand a second of the third's from then on, and reads some of them; a thread of the
// fourth wakes a thousand times a second and takes nothing: what the waking alone costs. The engines take
// turns of a round each, frames of one coming while the others rest, so that what else the machine does falls
// on all of them. What the held one kept in memory, beyond what the newest one has anyway, is measured when
// it is let go of.
// Releasing, the mapper's letting go of older versions once the newest is handed out, is told beside.
// --speed 4: four recorded seconds a second; an hour of frames then takes 15 minutes an engine.
// Ends with 1 when a ratio of p99 is over the aim.
#include <malloc.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "twofold/slam.hpp"
#include "twofold/source.hpp"

namespace twofold {
namespace {

using Clock = std::chrono::steady_clock;

enum class Holder : std::uint8_t { kNobody, kOneForEver, kThousandASecond, kWakesOnly, kCount };
constexpr std::size_t kHolders = static_cast<std::size_t>(Holder::kCount);
constexpr std::array<const char*, kHolders> kNames{"nobody holds a map", "one is held all the time",
                                                   "1000 are taken a second", "1000 wakings a second"};

struct Figures {
  double frame_p50 = 0, frame_p99 = 0;                       ///< [ms]
  double publish_p50 = 0, publish_p99 = 0, release_p99 = 0;  ///< [ms]
  double held = 0;                                           ///< freed by letting go of the held map [MB]
  double map = 0;                                            ///< the newest map at the end [MB]
};

/// Walks through all that a reader can see, as one that draws it would.
double read(const MapSnapshot& map) {
  double sum = 0;
  for (const MapSnapshot::Keyframe& keyframe : map.keyframes()) sum += keyframe.T_world_camera.t[0];
  for (const MapSnapshot::Point& point : map.points(false)) sum += point.position[0];
  return sum;
}

/// What is played again and again: it ends where it begins.
struct Round {
  std::vector<FrameView> frames;
  double rate = 30;  ///< frames a second
};

double heap_mb() {
  const struct mallinfo2 info = ::mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) * 1e-6;
}

/// An engine, and who holds maps of it.
class Walker {
 public:
  Walker(Holder holder, const CameraRig& rig, const Round& round)
      : holder_(holder), round_(round), slam_(std::make_unique<Slam>(rig, SlamOptions{})) {}

  /// Frames as many as a round has at most, at their rate; while they come, the holder is at work.
  void play(std::size_t frames, bool holding) {
    std::jthread user([&](const std::stop_token& stop) {
      if (holding) hold(stop);
    });
    auto due = Clock::now();
    for (std::size_t n = 0; n < frames; ++n) {
      due += std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 / round_.rate));
      std::this_thread::sleep_until(due);
      FrameView frame = round_.frames[played_ % round_.frames.size()];
      frame.t_ns = static_cast<std::int64_t>(played_) * 33'333'333;
      if (!slam_->wait_for_room(-1))
        throw std::runtime_error("the run has failed: " + slam_->errors().front());
      (void)slam_->push(frame);
      ++played_;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // what the map has still to do
  }

  Figures finish() {
    Figures figures;
    for (const StageTime& stage : slam_->finish().timings) {
      if (stage.thread == "tracker" && stage.stage == "frame") {
        figures.frame_p50 = stage.p50_ms;
        figures.frame_p99 = stage.p99_ms;
      }
      if (stage.thread == "mapper" && stage.stage == "publish") {
        figures.publish_p50 = stage.p50_ms;
        figures.publish_p99 = stage.p99_ms;
      }
      if (stage.thread == "mapper" && stage.stage == "release") figures.release_p99 = stage.p99_ms;
    }
    const MapSnapshot newest = slam_->map();
    figures.map = static_cast<double>(newest.memory_bytes()) * 1e-6;
    slam_.reset();  // which may have versions of its own
    const double before = heap_mb();
    held_ = {};
    figures.held = before - heap_mb();
    return figures;
  }

 private:
  void hold(const std::stop_token& stop) {
    if (holder_ == Holder::kNobody) return;
    const bool many = holder_ != Holder::kOneForEver;
    if (!many && held_.version() == 0) held_ = slam_->map();
    constexpr int kReadOneIn = 500;   // two a second, as of the one that is held
    static std::atomic<double> used;  // what is read is
    auto next = Clock::now();
    for (int n = 0; !stop.stop_requested(); ++n) {
      next += many ? std::chrono::milliseconds(1) : std::chrono::milliseconds(500);
      if (holder_ != Holder::kWakesOnly) {
        const MapSnapshot map = many ? slam_->map() : held_;
        if (!many || n % kReadOneIn == 0) used = read(map);
      }
      std::this_thread::sleep_until(next);
    }
  }

  Holder holder_;
  const Round& round_;
  std::unique_ptr<Slam> slam_;
  MapSnapshot held_;
  std::size_t played_ = 0;
};

/// The largest ratio of frames and publications.
double print(const std::array<Figures, kHolders>& figures) {
  fmt::print("{:26} {:>14} {:>14} {:>16} {:>16} {:>16} {:>9} {:>9}   ratio of p99: frame, publish, release\n",
             "", "frame p50 [ms]", "frame p99 [ms]", "publish p50 [ms]", "publish p99 [ms]",
             "release p99 [ms]", "map [MB]", "held [MB]");
  double most = 0;
  for (std::size_t h = 0; h < kHolders; ++h) {
    const Figures& of = figures[h];
    const double frame = of.frame_p99 / figures[0].frame_p99,
                 publish = of.publish_p99 / figures[0].publish_p99;
    fmt::print("{:26} {:14.3f} {:14.3f} {:16.4f} {:16.4f} {:16.4f} {:9.2f} {:9.2f}   {:.3f} {:.3f} {:.3f}\n",
               kNames[h], of.frame_p50, of.frame_p99, of.publish_p50, of.publish_p99, of.release_p99, of.map,
               of.held, frame, publish, of.release_p99 / figures[0].release_p99);
    most = std::max({most, frame, publish});
  }
  return most;
}

double run(double seconds, double speed) {
  constexpr std::size_t kRound = 900;
  Source source(fmt::format("synthetic:courtyard?frames={}", kRound), {.preload = true});
  Round round{{}, 30 * speed};
  for (FrameView frame; source.next(frame);) round.frames.push_back(frame);
  std::vector<std::unique_ptr<Walker>> walkers;
  for (std::size_t h = 0; h < kHolders; ++h)
    walkers.push_back(std::make_unique<Walker>(static_cast<Holder>(h), source.rig(), round));
  const auto frames = static_cast<std::size_t>(30 * seconds);
  const std::size_t turn = std::min(kRound, frames / 2);
  for (std::size_t played = 0; played < frames; played += turn) {
    for (const auto& walker : walkers) walker->play(std::min(turn, frames - played), played > 0);
  }
  std::array<Figures, kHolders> figures;
  for (std::size_t h = 0; h < kHolders; ++h) figures[h] = walkers[h]->finish();
  return print(figures);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app{"What it costs tracker and mapper that users hold maps"};
  double seconds = 30, most = 1.05, speed = 1;
  app.add_option("--seconds", seconds, "of frames for each")
      ->check(CLI::Range(2.0, 86400.0))
      ->capture_default_str();
  app.add_option("--speed", speed, "recorded seconds a second")
      ->check(CLI::Range(0.1, 100.0))
      ->capture_default_str();
  app.add_option("--most", most, "ratio of p99 that is aimed at: above it the exit code is 1")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return twofold::run(seconds, speed) > most ? 1 : 0;
}
