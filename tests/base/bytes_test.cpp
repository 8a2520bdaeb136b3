#include "base/bytes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>
#include <vector>

#include "base/checksum.hpp"

namespace twofold {
namespace {

std::span<const std::uint8_t> bytes_of(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

TEST(Bytes, NumbersStandWithTheLowestByteFirst) {
  ByteWriter out;
  out.put(std::uint8_t{0x01});
  out.put(std::uint32_t{0x05040302});
  out.put(-2.5);
  const std::array<std::uint8_t, 13> expected{1, 2, 3, 4, 5, 0, 0, 0, 0, 0, 0, 0x04, 0xC0};
  EXPECT_TRUE(std::equal(out.bytes().begin(), out.bytes().end(), expected.begin(), expected.end()));
}

TEST(Bytes, WhatWasPutIsRead) {
  ByteWriter out;
  out.put(std::uint16_t{65535});
  out.put(std::numeric_limits<std::uint64_t>::max() - 1);
  out.put(std::int32_t{-7});
  out.put(std::uint32_t{3});
  out.put_bytes(bytes_of("abc"));
  out.put_bytes(bytes_of("the rest"));
  ByteReader in(out.bytes());
  EXPECT_EQ(in.u16(), 65535);
  EXPECT_EQ(in.u64(), std::numeric_limits<std::uint64_t>::max() - 1);
  EXPECT_EQ(in.number<std::int32_t>(), -7);
  EXPECT_EQ(in.text(), "abc");
  EXPECT_EQ(in.at(), 21U);
  EXPECT_EQ(in.rest().size(), 8U);
  EXPECT_TRUE(in.at_end());
}

TEST(Bytes, NothingIsReadBeyondTheEnd) {
  const std::array<std::uint8_t, 7> bytes{4, 0, 0, 0, 1, 2, 3};
  for (std::size_t size = 0; size < 4; ++size)
    EXPECT_THROW((void)ByteReader(std::span(bytes).first(size)).u32(), MalformedBytes) << size;
  EXPECT_THROW((void)ByteReader(bytes).block(), MalformedBytes);
  ByteReader in(bytes);
  (void)in.u32();
  EXPECT_THROW((void)in.u32(), MalformedBytes);
  EXPECT_EQ(in.at(), 4U) << "a failed read takes nothing";
  EXPECT_EQ(in.remaining(), 3U);
}

TEST(Bytes, AStatedSizeCannotWrapAround) {
  const std::array<std::uint8_t, 2> bytes{1, 2};
  ByteReader in(bytes);
  (void)in.u8();
  EXPECT_THROW((void)in.take(std::numeric_limits<std::uint64_t>::max()), MalformedBytes);
  EXPECT_EQ(in.u8(), 2);
}

TEST(Bytes, ReleasedBytesAreGone) {
  ByteWriter out;
  out.put('x');
  EXPECT_EQ(out.release(), std::vector<std::uint8_t>{'x'});
  EXPECT_EQ(out.size(), 0U);
}

TEST(Checksum, IsTheStandards) {
  EXPECT_EQ(crc32_of(bytes_of("123456789")), 0xCBF43926U);
  EXPECT_EQ(crc32_of({}), 0U);
}

TEST(Checksum, GoesOnBehindOtherBytes) {
  const std::uint32_t before = crc32_of(bytes_of("1234"));
  EXPECT_EQ(crc32_of(bytes_of("56789"), before), 0xCBF43926U);
  EXPECT_EQ(crc32_of({}, before), before) << "no bytes change nothing";
}

}  // namespace
}  // namespace twofold
