#include "io/sources/source_parameters.hpp"

#include "io/sources/open_source.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

TEST(SourceSpec, SplitsSchemeArgumentAndParameters) {
  const auto spec = parse_source_spec("synthetic:courtyard?frames=900&seed=1");
  EXPECT_EQ(spec.scheme, "synthetic");
  EXPECT_EQ(spec.argument, "courtyard");
  EXPECT_EQ(spec.parameters, (std::map<std::string, std::string>{{"frames", "900"}, {"seed", "1"}}));
  EXPECT_EQ(parse_source_spec("dir/sub").scheme, "");
}

TEST(SourceSpec, LeavesExistingPathsWhole) {
  const ScratchFolder folder;
  const auto odd = folder.write("odd?a=b/x", "").parent_path();
  EXPECT_EQ(parse_source_spec(odd.string()).argument, odd.string());
  EXPECT_EQ(parse_source_spec("kitti:" + odd.string()).argument, odd.string());
}

TEST(SourceSpec, RejectsMalformedParameters) {
  EXPECT_IO_ERROR(parse_source_spec("kitti:a?b"), "not of the form key=value");
  EXPECT_IO_ERROR(parse_source_spec("kitti:a?b=1&b=2"), "given twice");
  EXPECT_IO_ERROR(parse_source_spec("kitti:"), "names no folder");
  EXPECT_IO_ERROR(parse_source_spec(""), "names no folder");
}

TEST(OpenSource, NamesWhatItCannotOpen) {
  const ScratchFolder folder;
  EXPECT_IO_ERROR(open_source(folder / "missing"), "missing: no such file or folder");
  EXPECT_IO_ERROR(open_source("kitti:" + (folder / "missing")), "no such folder");
  EXPECT_IO_ERROR(open_source(folder.path().string()), "the folder is empty");
  EXPECT_IO_ERROR(open_source("tum:" + folder.path().string()), "the folder is empty");
  EXPECT_IO_ERROR(open_source("nonsense:x"), "unknown kind of source 'nonsense'");
  EXPECT_IO_ERROR(open_source("video:" + (folder / "none.mp4")), "no such video file");
  const auto text = folder.write("not_a_video.mp4", "hello");
  EXPECT_IO_ERROR(open_source(text.string() + "?fx=1&fy=1&cx=1&cy=1"), "is not a video");
  EXPECT_IO_ERROR(open_source(folder.path().string()), "no known layout");
}

}  // namespace
}  // namespace twofold
