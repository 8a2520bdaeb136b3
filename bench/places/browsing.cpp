// Hours in a mapped place: every keyframe is redundant and culled soon, ids grow, the map does not. What the
// loop closer remembers, takes for a keyframe, and still finds.

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <deque>
#include <exception>
#include <memory>
#include <vector>

#include <fmt/format.h>

#include "fixtures/live_memory.hpp"
#include "fixtures/rendered_scene.hpp"
#include "graph/graph_writer.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "loopclosure/loop_closer.hpp"

namespace twofold::bench {
namespace {

constexpr int kPlaces = 15;         // keyframes that stay
constexpr std::size_t kRecent = 8;  // keyframes until a redundant one is culled, as the mapper does
constexpr std::size_t kKept = 128;  // replacements that stay known
constexpr int kAsked = 21;

class Browsing {
 public:
  Browsing() {
    for (int n = 0; n < kPlaces; ++n) views_.push_back(render(2 * M_PI * n / kPlaces));
    for (int n = 0; n < kAsked; ++n) asked_.push_back(render(2 * M_PI * (n + 0.3) / kAsked).images);
    for (int n = 0; n < kPlaces; ++n) add(n);
  }

  void browse(std::uint32_t until) {
    while (next_ < until) {
      recent_.push_back(add(static_cast<int>(next_ * 7 % kPlaces)));
      if (recent_.size() <= kRecent) continue;
      writer_.cull_keyframe(recent_.front(), KeyframeId{0});
      writer_.forget_replacements(kKept);
      recent_.pop_front();
    }
  }

  void report() {
    const GraphSnapshot graph = writer_.publish();
    int remembered = 0, found = 0;
    for (std::uint32_t k = 0; k < next_; ++k) remembered += closer_.places().find(KeyframeId{k}) ? 1 : 0;
    for (const FrameImages& images : asked_) found += closer_.relocalise(images, graph) ? 1 : 0;
    fmt::print("{:>9} {:>10} {:>7}/{} {:>10.2f} {:>9.1f}\n", next_, remembered, found, kAsked,
               steps_ > 0 ? step_ms_ / steps_ : 0.0, static_cast<double>(resident_bytes()) / (1 << 20));
    std::fflush(stdout);
    step_ms_ = 0;
    steps_ = 0;
  }

 private:
  KeyframeProposal render(double yaw) {
    const SO3 R_c_w = SO3::exp(Vector3(0, yaw, 0));
    KeyframeProposal view;
    scene_.render(SE3(R_c_w, -(R_c_w * Vector3(0.2 * std::sin(3 * yaw), 0, 0))), 1.5, view.images);
    return view;
  }

  KeyframeId add(int view) {
    KeyframeProposal& proposal = views_[static_cast<std::size_t>(view)];
    proposal.id = KeyframeId{next_++};
    Keyframe keyframe;
    keyframe.id = proposal.id;
    keyframe.median_depth = 3;
    writer_.add_keyframe(keyframe);
    writer_.set_reference(proposal.id);
    const GraphSnapshot graph = writer_.publish();
    const auto begin = std::chrono::steady_clock::now();
    (void)closer_.step(proposal, graph);
    step_ms_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    ++steps_;
    return proposal.id;
  }

  Rig rig_ = testing::test_rig(SensorKind::kRgbd, 320, 240);
  testing::RenderedScene scene_{rig_, Vector3(3, 2, 4), 1};
  LoopCloser closer_{rig_, std::make_shared<const Vocabulary>(load_default_vocabulary()), {}};
  GraphWriter writer_;
  std::vector<KeyframeProposal> views_;
  std::vector<FrameImages> asked_;
  std::deque<KeyframeId> recent_;
  std::uint32_t next_ = 0;
  double step_ms_ = 0;
  int steps_ = 0;
};

int main_of(int argc, char** argv) {
  CLI::App app("Browsing a mapped place for hours: what the loop closer remembers and finds");
  std::uint32_t keyframes = 200'000;
  app.add_option("--keyframes", keyframes, "Made in all")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  Browsing browsing;
  fmt::print("{:>9} {:>10} {:>10} {:>10} {:>9}\n", "keyframes", "remembered", "found", "ms a step",
             "RSS [MB]");
  browsing.report();
  for (std::uint32_t part = 1; part <= 10; ++part) {
    browsing.browse(keyframes / 10 * part);
    browsing.report();
  }
  return 0;
}

}  // namespace
}  // namespace twofold::bench

int main(int argc, char** argv) {
  try {
    return twofold::bench::main_of(argc, argv);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
