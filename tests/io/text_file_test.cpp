#include "io/files/text_file.hpp"

#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

TEST(TextFile, SecondsAreExactToTheNanosecond) {
  EXPECT_EQ(seconds_to_ns("1305031110.043299"), 1305031110043299000);
  EXPECT_EQ(seconds_to_ns("1403715273.262142976"), 1403715273262142976);
  EXPECT_EQ(seconds_to_ns("0"), 0);
  EXPECT_EQ(seconds_to_ns("1.036000e-01"), 103600000);
  EXPECT_EQ(seconds_to_ns("7."), 7000000000);
  for (const std::int64_t t : {std::int64_t{0}, std::int64_t{999999999}, std::int64_t{1403715273262142976}}) {
    EXPECT_EQ(seconds_to_ns(ns_to_seconds(t)), t);
  }
}

TEST(TextFile, RejectsWhatIsNoTimeOrNumber) {
  for (const char* text : {"", "-1", "nan", "inf", "1e30", "99999999999999", "1.2.3", "abc", "1 2"}) {
    EXPECT_FALSE(seconds_to_ns(text)) << text;
  }
  for (const char* text : {"", "nan", "-inf", "1e999", "1,5", "0x10", "3m"})
    EXPECT_FALSE(to_number(text)) << text;
  EXPECT_EQ(to_number("+2.5e1"), 25.0);
}

TEST(TextFile, SkipsCommentsAndWindowsLineEnds) {
  const ScratchFolder folder;
  const auto file = folder.write("a.txt", "# c\r\n\r\n  1 2\r\n#x\n3 4");
  const auto lines = read_text_lines(file);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].text, "  1 2");
  EXPECT_EQ(lines[0].number, 3);
  EXPECT_EQ(lines[1].number, 5);
  EXPECT_IO_ERROR(read_text_lines(folder.path() / "none"), "none: no such file");
  EXPECT_IO_ERROR(read_text_lines(folder.path()), "cannot be opened");
}

}  // namespace
}  // namespace twofold
