// Looking up words: a descriptor, and all a keyframe does before the place index is asked.
#include <benchmark/benchmark.h>

#include "fixtures/rendered_scene.hpp"
#include "imaging/corner_selection.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

struct Keyframe {
  Keyframe() {
    testing::RenderedScene scene(testing::test_rig(SensorKind::kStereo), {3, 2, 5}, 21);
    images.build(scene.render_one(SE3(), 2));
    CornerSelector({}).select(images, corners);
    CornerDescriber().describe(images, corners);
  }
  Vocabulary vocabulary = load_default_vocabulary();
  ImagePyramid images;
  std::vector<DescribedCorner> corners;
};

const Keyframe& keyframe() {
  static const Keyframe one;
  return one;
}

void vocabulary_word(benchmark::State& state) {
  const Keyframe& one = keyframe();
  std::size_t n = 0;
  for (auto _ : state) {
    const DescribedCorner& corner = one.corners[n++ % one.corners.size()];
    benchmark::DoNotOptimize(one.vocabulary.word(corner.descriptor));
  }
}
BENCHMARK(vocabulary_word);

void vocabulary_bag(benchmark::State& state) {
  const Keyframe& one = keyframe();
  for (auto _ : state) benchmark::DoNotOptimize(one.vocabulary.bag(one.corners));
  state.counters["corners"] = static_cast<double>(one.corners.size());
}
BENCHMARK(vocabulary_bag)->Unit(benchmark::kMicrosecond);

void select_and_describe(benchmark::State& state) {
  const Keyframe& one = keyframe();
  CornerSelector selector({});
  CornerDescriber describer;
  std::vector<DescribedCorner> corners;
  for (auto _ : state) {
    corners.clear();
    selector.select(one.images, corners);
    describer.describe(one.images, corners);
  }
}
BENCHMARK(select_and_describe)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace twofold
