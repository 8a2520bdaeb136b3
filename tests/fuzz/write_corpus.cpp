// Writes small maps for the fuzzer to start from: write_corpus FOLDER

#include <filesystem>
#include <string>

#include "tests/graph/sample_map.hpp"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  for (int i = 1; i <= 4; ++i) {
    twofold::save_map(folder / ("map" + std::to_string(i) + ".tfm"),
                      twofold::testing::sample_map(3 * i, 5 * i, static_cast<std::uint32_t>(i)));
  }
  return 0;
}
