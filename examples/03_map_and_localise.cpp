// A map is made, saved, and a camera finds itself in it.
//   03_map_and_localise [SOURCE [MAP]]
#include <cstdio>
#include <exception>
#include <string>

#include <twofold/slam.hpp>
#include <twofold/source.hpp>

namespace {

/// Every frame of the source, none dropped.
twofold::SlamSummary track_all(twofold::Slam& slam, const std::string& name) {
  twofold::Source source(name);
  twofold::FrameView frame;
  while (source.next(frame)) {
    while (!slam.wait_for_room(1'000'000'000)) {
      if (slam.ended()) return slam.finish();
    }
    slam.push(frame);
  }
  return slam.finish();
}

void describe(const twofold::MapSnapshot& map) {
  const auto keyframes = map.keyframes();
  const auto edges = map.edges();
  std::size_t marginalised = 0;
  for (const auto& edge : edges) marginalised += edge.kind == twofold::MapSnapshot::EdgeKind::kMarginalised;
  std::printf("map version %llu: %zu keyframes, %zu points, %zu edges (%zu marginalised), %zu part(s)\n",
              static_cast<unsigned long long>(map.version()), keyframes.size(), map.points(false).size(),
              edges.size(), marginalised, map.parts().size());
}

int run(const std::string& source, const std::string& file) {
  const twofold::CameraRig rig = twofold::Source(source).rig();
  {
    twofold::Slam slam(rig, {});
    const auto summary = track_all(slam, source);
    std::printf("mapping: %lld of %lld frames tracked\n", static_cast<long long>(summary.tracked),
                static_cast<long long>(summary.frames));
    describe(slam.map());
    slam.save_map(file);
  }
  twofold::Slam slam(rig, {.map = file, .localise_only = true});
  const auto summary = track_all(slam, source);
  std::printf("localising: %lld of %lld frames placed in the map\n", static_cast<long long>(summary.tracked),
              static_cast<long long>(summary.frames));
  return 2 * summary.tracked > summary.frames ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) try {
  return run(argc > 1 ? argv[1] : "synthetic:desk?frames=90", argc > 2 ? argv[2] : "example.tfm");
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
