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

TEST(TextFile, TimesAreExactInEveryUnit) {
  EXPECT_EQ(time_to_ns("1403636579763555328.000000", TimeUnit::kNanoseconds), 1403636579763555328);
  EXPECT_EQ(time_to_ns("1403636579763555.328", TimeUnit::kMicroseconds), 1403636579763555328);
  EXPECT_EQ(time_to_ns("1403636579763.555328", TimeUnit::kMilliseconds), 1403636579763555328);
  EXPECT_EQ(time_to_ns("1403636579.7635553289", TimeUnit::kSeconds), 1403636579763555328);
  EXPECT_EQ(time_to_ns("2e3", TimeUnit::kMicroseconds), 2000000);
  EXPECT_FALSE(time_to_ns("1403636579763555328", TimeUnit::kMicroseconds));
}

TEST(TextFile, SecondsThatCanOnlyBeNanosecondsAreThese) {
  EXPECT_EQ(seconds_field("a.txt", 1, "1403636579763555328.000000"), 1403636579763555328);
  EXPECT_EQ(seconds_field("a.txt", 1, "1403636579.5"), 1403636579500000000);
  EXPECT_IO_ERROR(seconds_field("a.txt", 1, "1403636579763.5"), "large in milliseconds or microseconds");
  EXPECT_EQ(nanoseconds_field("a.txt", 1, "1403636579763555328.000"), 1403636579763555328);
  EXPECT_IO_ERROR(nanoseconds_field("a.txt", 1, "1403636579.763555328"), "not a time stamp in nanoseconds");
}

/// As editors and spreadsheets of Windows write them.
TEST(TextFile, AByteOrderMarkIsNoPartOfTheFirstLine) {
  const ScratchFolder folder;
  const auto lines = read_text_lines(folder.write("a.txt",
                                                  "\xef\xbb\xbf"
                                                  "1 2 \t\r\n3 4\r\n"));
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0].text, "1 2");
  EXPECT_EQ(read_text_lines(folder.write("b.txt", "\xef\xbb\xbf# c\n3 4\n")).size(), 1u);
  EXPECT_IO_ERROR(read_text_lines(folder.write("c.txt", std::string("\xff\xfe"
                                                                    "1\0",
                                                                    4))),
                  "c.txt: is UTF-16 text: save it as UTF-8");
}

TEST(TextFile, TablesMayHaveAHeading) {
  const ScratchFolder folder;
  const auto first = [&](const std::string& text) {
    const auto lines = read_table_lines(folder.write("a.txt", text));
    return lines.empty() ? "" : lines[0].text;
  };
  EXPECT_EQ(first("timestamp [ns],filename\n1,1.png\n"), "1,1.png");
  EXPECT_EQ(first("# of a camera\n\"time\";\"x\"\n1 2\n"), "1 2");
  EXPECT_EQ(first("img1 0.5\n"), "img1 0.5") << "an image and its time";
  EXPECT_EQ(first("nan nan\n1 2\n"), "nan nan");
  EXPECT_EQ(first("-inf x\n1 2\n"), "-inf x");
  EXPECT_EQ(first("t x\na b\n"), "a b") << "the first line only";
}

}  // namespace
}  // namespace twofold
