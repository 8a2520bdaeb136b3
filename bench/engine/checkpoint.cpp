// What saving a large map costs the mapper, and what the file costs: rounds of the mapper on a map of 20,000
// keyframes, alone and while another thread saves what it publishes, over and over.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <filesystem>
#include <memory>
#include <random>

#include "bench/mapping/simulated_run.hpp"
#include "engine/clock.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "engine/worker.hpp"
#include "graph/map_file.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "loopclosure/loop_closer.hpp"
#include "mapping/mapper.hpp"

namespace twofold {
namespace {

using simulation::Simulation;

double ms_since(std::int64_t begin_ns) {
  return static_cast<double>(steady_now_ns() - begin_ns) * 1e-6;
}

/// Each keyframe has as many corners as are described of a real one; what they say does not matter here.
KeyframeDatabase described(std::uint32_t keyframes, const Rig& rig) {
  constexpr int kCorners = 500;
  std::mt19937_64 rng(1);
  KeyframeDatabase places;
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    PlaceAppearance place;
    for (int n = 0; n < kCorners; ++n) {
      DescribedCorner corner;
      corner.uv = {static_cast<float>(rng() % static_cast<unsigned>(rig.camera.width)),
                   static_cast<float>(rng() % static_cast<unsigned>(rig.camera.height))};
      for (std::uint64_t& bits : corner.descriptor.bits) bits = rng();
      place.corners.push_back(corner);
      place.pixels.emplace_back(corner.uv.x(), corner.uv.y(), corner.uv.x() - 10);
    }
    places.set(KeyframeId{k}, std::move(place));
  }
  return places;
}

/// Rounds with the default windows, published to one reader.
class Rounds {
 public:
  Rounds(Simulation& simulation, Mapper& mapper, SnapshotPublisher<GraphSnapshot>& snapshots)
      : simulation_(simulation), mapper_(mapper), snapshots_(snapshots) {}

  /// @param enough  asked after `count` rounds
  template <class Enough>
  void measure(int count, const char* what, Enough&& enough) {
    Samples round_ms, publish_ms;
    while (static_cast<int>(round_ms.values.size()) < count || !enough()) {
      KeyframeProposal* proposal = &simulation_.propose(mapper_.graph());
      std::int64_t begin_ns = steady_now_ns();
      mapper_.step(std::span(&proposal, 1));
      round_ms.add(ms_since(begin_ns));
      begin_ns = steady_now_ns();
      snapshots_.publish(mapper_.publish());
      publish_ms.add(ms_since(begin_ns));
      snapshots_.collect();
    }
    fmt::print("{:<14} {:6} {:9.2f} {:9.2f} {:9.2f} {:11.4f} {:11.4f} {:11.4f}\n", what,
               round_ms.values.size(), round_ms.quantile(0.5), round_ms.quantile(0.99), round_ms.quantile(1),
               publish_ms.quantile(0.5), publish_ms.quantile(0.99), publish_ms.quantile(1));
  }

 private:
  Simulation& simulation_;
  Mapper& mapper_;
  SnapshotPublisher<GraphSnapshot>& snapshots_;
};

void measure_loading(const std::filesystem::path& file, const Rig& rig) {
  std::int64_t begin_ns = steady_now_ns();
  const SavedMap map = load_map(file);
  const double load_ms = ms_since(begin_ns);
  LoopCloser closer(rig, std::make_shared<const Vocabulary>(load_default_vocabulary()), {});
  begin_ns = steady_now_ns();
  closer.continue_from(map.places);
  fmt::print("load {:.0f} ms, of {} keyframes; words and inverted file anew {:.0f} ms\n", load_ms,
             map.graph.keyframe_count(), ms_since(begin_ns));
}

void run(int keyframes, int rounds, const std::filesystem::path& file) {
  Simulation simulation = exploration(keyframes + 20 * rounds);
  auto filler = std::make_unique<Mapper>(simulation.rig(), exploring(3, 6), simulation.search(10));
  const auto fill = [&](Mapper& mapper, int until) {
    while (static_cast<int>(mapper.graph().keyframe_count()) < until) {
      KeyframeProposal* proposal = &simulation.propose(mapper.graph());
      mapper.step(std::span(&proposal, 1));
    }
  };
  fill(*filler, keyframes - 60);
  Mapper mapper(simulation.rig(), exploring(25, 175), simulation.search(10));
  mapper.continue_from(filler->publish());
  filler.reset();
  fill(mapper, keyframes);
  const KeyframeDatabase places = described(static_cast<std::uint32_t>(keyframes), simulation.rig());

  SnapshotPublisher<GraphSnapshot> snapshots(1, mapper.publish());
  Rounds measured(simulation, mapper, snapshots);
  fmt::print("{:<14} {:>6} {:>9} {:>9} {:>9} {:>11} {:>11} {:>11}\n", "", "rounds", "median ms", "p99 ms",
             "max ms", "publish ms", "p99 ms", "max ms");
  measured.measure(rounds, "alone", [] { return true; });
  Samples save_ms;
  std::atomic<int> saves{0};
  {
    Worker saver({.name = "checkpoints"}, [&](const std::stop_token& stop) {
      yield_to_other_threads();
      while (!stop.stop_requested()) {
        const std::int64_t begin_ns = steady_now_ns();
        save_map(file, simulation.rig(), snapshots.mailbox(0).latest(), places);
        save_ms.add(ms_since(begin_ns));
        saves.fetch_add(1, std::memory_order_relaxed);
      }
    });
    measured.measure(rounds, "while saving", [&] { return simulation.done() || saves.load() >= 2; });
  }
  fmt::print("{} saves, median {:.0f} ms, {:.0f} MB\n", save_ms.values.size(), save_ms.quantile(0.5),
             static_cast<double>(std::filesystem::file_size(file)) * 1e-6);
  measure_loading(file, simulation.rig());
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace twofold

int main(int argc, char** argv) {
  CLI::App app("What saving a large map costs the mapper");
  int keyframes = 20000, rounds = 200;
  std::string file = std::filesystem::temp_directory_path() / "twofold_checkpoint_bench.tfm";
  app.add_option("--keyframes", keyframes, "Size of the map")->check(CLI::Range(100, 1000000));
  app.add_option("--rounds", rounds, "Rounds measured alone, and at least while saving")
      ->check(CLI::Range(2, 100000));
  app.add_option("--file", file, "Written to, then removed");
  CLI11_PARSE(app, argc, argv);
  twofold::run(keyframes, rounds, file);
  return 0;
}
