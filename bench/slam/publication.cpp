// What it costs the mapper to publish a version of the map, beside users' threads that hold maps: nobody
// holds one; one is held from the first turn to the last; a thousand are taken a second; a thread wakes a
// thousand times a second and takes nothing. Rounds without a camera, hundreds a second, so that quantiles
// stand on thousands of them: a writer moves the points and keyframes of a window as large as a mapper's,
// publishes as a mapper does, and lets go of the versions before, while a thread reads the newest one as
// tracker and loop closer do. What is worked out for events before a version is published is in none of the
// figures.
// The four take turns of a second. Ends with 1 when a ratio of publication's p99 is over the aim.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "base/processor_time.hpp"
#include "engine/clock.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "graph/graph_writer.hpp"
#include "slam/map_lender.hpp"
#include "slam/map_movements.hpp"

namespace twofold {
namespace {

enum class Holder : std::uint8_t { kNobody, kOneForEver, kThousandASecond, kWakesOnly, kCount };
constexpr std::size_t kHolders = static_cast<std::size_t>(Holder::kCount);
constexpr std::array<const char*, kHolders> kNames{"nobody holds a map", "one is held all the time",
                                                   "1000 are taken a second", "1000 wakings a second"};

// As in the rendered courtyard at 640x480.
constexpr std::uint32_t kKeyframes = 260, kPoints = 24'000;
constexpr std::uint32_t kWindow = 200, kInner = 25;            ///< keyframes that a round moves
constexpr std::uint32_t kMovedPoints = 1800;                   ///< points that it moves
constexpr std::size_t kScratch = (1U << 20) / sizeof(double);  ///< values that a solver goes through between

struct Durations {
  std::vector<std::int64_t> publish_ns, release_ns, cpu_ns;
};

double quantile_us(std::vector<std::int64_t> ns, double q) {
  std::sort(ns.begin(), ns.end());
  return static_cast<double>(ns[static_cast<std::size_t>(q * static_cast<double>(ns.size() - 1))]) * 1e-3;
}

double mean_us(const std::vector<std::int64_t>& ns) {
  double sum = 0;
  for (const std::int64_t value : ns) sum += static_cast<double>(value) * 1e-3;
  return sum / static_cast<double>(ns.size());
}

Keyframe keyframe_number(std::uint32_t number) {
  Keyframe keyframe;
  keyframe.id = KeyframeId{number};
  keyframe.T_k_w = SE3(SO3(), Vector3(0.1 * number, 0, 0));
  return keyframe;
}

/// A mapper's side of the map, and who holds versions of it.
class Map {
 public:
  explicit Map(Holder holder) : holder_(holder), scratch_(kScratch, 1.0) {
    for (std::uint32_t k = 0; k < kKeyframes; ++k) writer_.add_keyframe(keyframe_number(k));
    const auto appearance = std::make_shared<const PointAppearance>();
    for (std::uint32_t p = 0; p < kPoints; ++p) {
      MapPoint point;
      point.anchor = KeyframeId{p * kKeyframes / kPoints};
      point.appearance = appearance;
      writer_.add_point(PointId{p}, std::move(point));
    }
    window_.nodes.resize(kWindow);
    window_.inner = kInner;
    for (int n = 0; n < 3; ++n) round();
    durations_ = {};
  }

  void play(std::chrono::nanoseconds turn, std::chrono::nanoseconds period) {
    const std::jthread user([&](const std::stop_token& stop) { hold(stop); });
    const std::jthread reader([&](const std::stop_token& stop) { follow(stop); });
    const auto end = std::chrono::steady_clock::now() + turn;
    for (auto next = std::chrono::steady_clock::now(); next < end; next += period) {
      std::this_thread::sleep_until(next);
      round();
    }
  }
  [[nodiscard]] const Durations& durations() const { return durations_; }

 private:
  /// What a round of the mapper does to the map, and its publication.
  void round() {
    for (double& value : scratch_) value *= 1.0000001;
    const std::uint32_t first = (++round_ * 3) % (kKeyframes - kWindow);
    for (std::uint32_t n = 0; n < kWindow; ++n) {
      const KeyframeId id{first + n};
      window_.nodes[n].id = id;
      writer_.set_pose(id, SE3(SO3(), Vector3(0.1 * (first + n), 1e-3 * (round_ % 7), 0)));
    }
    const std::uint32_t first_point = first * (kPoints / kKeyframes);
    for (std::uint32_t n = 0; n < kMovedPoints; ++n)
      writer_.set_inverse_depth(PointId{first_point + n}, Vector3(0, 0, 1 + 1e-3 * (round_ % 5)));
    publish();
  }

  void publish() {
    movements_.made(writer_.graph(), window_);
    const std::int64_t cpu_begin_ns = thread_cpu_ns(), begin_ns = steady_now_ns();
    GraphSnapshot graph = writer_.publish();
    lender_.publish(graph, window_);
    snapshots_.publish(std::move(graph));
    const std::int64_t handed_out_ns = steady_now_ns();
    snapshots_.collect();
    const std::int64_t end_ns = steady_now_ns(), cpu_end_ns = thread_cpu_ns();
    durations_.publish_ns.push_back(handed_out_ns - begin_ns);
    durations_.release_ns.push_back(end_ns - handed_out_ns);
    durations_.cpu_ns.push_back(cpu_end_ns - cpu_begin_ns);
  }

  /// Tracker and loop closer.
  void follow(const std::stop_token& stop) {
    double sum = 0;
    while (!stop.stop_requested()) {
      const GraphSnapshot& graph = snapshots_.mailbox(0).latest();
      for (std::uint32_t p = 0; p < kPoints; p += 10) sum += graph.point(PointId{p}).psi.z();
      (void)movements_.take(graph.version());
      (void)snapshots_.mailbox(1).latest();
      lender_.catch_up();
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    volatile double used = sum;
    (void)used;
  }

  void hold(const std::stop_token& stop) {
    if (holder_ == Holder::kNobody) return;
    if (holder_ == Holder::kOneForEver) {
      if (!held_) held_ = lender_.newest();
      return;
    }
    auto next = std::chrono::steady_clock::now();
    while (!stop.stop_requested()) {
      next += std::chrono::milliseconds(1);
      if (holder_ == Holder::kThousandASecond) (void)lender_.newest();
      std::this_thread::sleep_until(next);
    }
  }

  Holder holder_;
  GraphWriter writer_;
  DoubleWindow window_;
  MapLender lender_;
  MapMovements movements_;
  SnapshotPublisher<GraphSnapshot> snapshots_{2, writer_.publish()};
  std::shared_ptr<const MapVersion> held_;
  std::vector<double> scratch_;
  std::uint32_t round_ = 0;
  Durations durations_;
};

/// The largest ratio of publications.
double print(const std::array<std::unique_ptr<Map>, kHolders>& maps) {
  fmt::print("{:26} {:>8} {:>24} {:>24} {:>10}   ratios of p99\n", "[us]", "rounds",
             "publish p50   p90   p99", "release p50   p90   p99", "CPU, mean");
  double most = 0;
  std::array<double, 2> alone{};
  for (std::size_t h = 0; h < kHolders; ++h) {
    const Durations& of = maps[h]->durations();
    const std::array<double, 2> p99{quantile_us(of.publish_ns, 0.99), quantile_us(of.release_ns, 0.99)};
    if (h == 0) alone = p99;
    fmt::print("{:26} {:8} {:12.1f} {:5.1f} {:5.1f} {:12.1f} {:5.1f} {:5.1f} {:10.2f}   {:.3f} {:.3f}\n",
               kNames[h], of.publish_ns.size(), quantile_us(of.publish_ns, 0.5),
               quantile_us(of.publish_ns, 0.9), p99[0], quantile_us(of.release_ns, 0.5),
               quantile_us(of.release_ns, 0.9), p99[1], mean_us(of.cpu_ns), p99[0] / alone[0],
               p99[1] / alone[1]);
    most = std::max(most, p99[0] / alone[0]);
  }
  return most;
}

double run(int turns, double rate) {
  std::array<std::unique_ptr<Map>, kHolders> maps;
  for (std::size_t h = 0; h < kHolders; ++h) maps[h] = std::make_unique<Map>(static_cast<Holder>(h));
  const std::chrono::nanoseconds period(static_cast<std::int64_t>(1e9 / rate));
  for (int turn = 0; turn < turns; ++turn) {
    for (const auto& map : maps) map->play(std::chrono::seconds(1), period);
  }
  return print(maps);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app{"What it costs to publish a version of the map, beside threads that hold maps"};
  int turns = 20;
  double most = 1.05, rate = 300;
  app.add_option("--turns", turns, "of a second for each")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--rate", rate, "rounds a second")->check(CLI::Range(1.0, 2000.0))->capture_default_str();
  app.add_option("--most", most, "ratio of p99 that is aimed at: above it the exit code is 1")
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return twofold::run(turns, rate) > most ? 1 : 0;
}
