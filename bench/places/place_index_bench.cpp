// Query and insertion of a keyframe in the place index, against the size of the map. Bags have the length of
// a keyframe's and words as frequent as the default vocabulary found them in its training images.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "loopclosure/default_vocabulary.hpp"
#include "loopclosure/place_index.hpp"

namespace twofold {
namespace {

constexpr double kWordsOfKeyframe = 450;

class BagMaker {
 public:
  BagMaker() : vocabulary_(load_default_vocabulary()) {
    double sum = 0;
    for (const Vocabulary::Node& node : vocabulary_.nodes()) {
      if (node.child_count == 0) sum += std::exp(-node.idf);
    }
    for (const Vocabulary::Node& node : vocabulary_.nodes()) {
      if (node.child_count == 0)
        words_.push_back({node.word, std::min(0.9, std::exp(-node.idf) * kWordsOfKeyframe / sum)});
    }
    std::sort(words_.begin(), words_.end());
  }
  [[nodiscard]] std::size_t word_count() const { return vocabulary_.word_count(); }

  BagOfWords bag() {
    BagOfWords bag;
    for (const auto& [word, share] : words_) {
      if (uniform_(random_) < share) bag.push_back({word, 1.0F});
    }
    for (auto& [word, weight] : bag) weight = 1.0F / static_cast<float>(bag.size());
    return bag;
  }

 private:
  Vocabulary vocabulary_;
  std::vector<std::pair<WordId, double>> words_;
  std::mt19937 random_{7};
  std::uniform_real_distribution<double> uniform_{0, 1};
};

void query_and_insert(benchmark::State& state) {
  BagMaker maker;
  PlaceIndex index(maker.word_count());
  const auto keyframes = static_cast<std::uint32_t>(state.range(0));
  for (std::uint32_t k = 0; k < keyframes; ++k) index.add(KeyframeId{k}, maker.bag());
  std::vector<BagOfWords> queries;
  for (int n = 0; n < 64; ++n) queries.push_back(maker.bag());
  const auto any = [](KeyframeId) { return true; };
  std::size_t n = 0;
  for ([[maybe_unused]] auto _ : state) {
    const BagOfWords& bag = queries[n++ % queries.size()];
    benchmark::DoNotOptimize(index.query(bag, 5, any));
    index.add(KeyframeId{keyframes}, bag);
    index.forget(keyframes + 1, [&](KeyframeId k) { return k == KeyframeId{keyframes}; });  // keeps its size
  }
}
BENCHMARK(query_and_insert)->Arg(100)->Arg(1000)->Arg(10000)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace twofold

BENCHMARK_MAIN();
