#include "io/bags/bag_reader.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "tests/io/bags/small_bag.hpp"

namespace twofold {
namespace {

using namespace testing;

using Reader = std::function<std::unique_ptr<BagReader>(const Bytes&)>;

std::unique_ptr<BagReader> mcap(const Bytes& bytes) {
  return read_mcap(bytes, "some.mcap");
}
std::unique_ptr<BagReader> rosbag(const Bytes& bytes) {
  return read_rosbag(bytes, "some.bag");
}

std::set<std::uint32_t> all_topics(const BagReader& reader) {
  std::set<std::uint32_t> ids;
  for (const BagTopic& topic : reader.topics()) ids.insert(topic.id);
  return ids;
}

/// Topics and messages are those that were written, in their order; and so they are the second time.
void expect_same(const WrittenBag& bag, BagReader& reader) {
  ASSERT_EQ(reader.topics().size(), bag.topics.size());
  std::map<std::uint32_t, std::string> names;
  for (std::size_t n = 0; n < bag.topics.size(); ++n) {
    EXPECT_EQ(reader.topics()[n].name, bag.topics[n].name);
    EXPECT_EQ(reader.topics()[n].type, bag.topics[n].type);
    names[reader.topics()[n].id] = reader.topics()[n].name;
  }
  for (int turn = 0; turn < 2; ++turn) {
    reader.select(all_topics(reader));
    BagMessage message;
    for (const WrittenMessage& written : bag.messages) {
      ASSERT_TRUE(reader.next(message));
      EXPECT_EQ(names[message.topic], bag.topics[written.topic].name);
      EXPECT_EQ(message.t_ns, written.t_ns);
      EXPECT_EQ(Bytes(message.data.begin(), message.data.end()), written.data);
    }
    EXPECT_FALSE(reader.next(message));
    EXPECT_EQ(reader.fault(), "");
  }
}

TEST(BagReader, GivesWhatAnMcapFileHolds) {
  for (const MessageEncoding encoding : {MessageEncoding::kCdr, MessageEncoding::kRos1}) {
    const WrittenBag bag = stereo_bag(encoding);
    for (const char* compression : {"", "zstd", "lz4"}) {
      for (const std::size_t chunk : {0, 1, 4, 1000}) {
        for (const bool summary : {true, false}) {
          SCOPED_TRACE(fmt::format("'{}' {} {}", compression, chunk, summary));
          const Bytes file = mcap_file(bag, {encoding, compression, chunk, summary, true});
          const auto reader = mcap(file);
          expect_same(bag, *reader);
          for (const BagTopic& topic : reader->topics()) EXPECT_EQ(topic.encoding, encoding);
        }
      }
    }
  }
}

TEST(BagReader, GivesWhatABagOfRos1Holds) {
  const WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
  for (const char* compression : {"none", "bz2", "lz4"}) {
    for (const bool index : {true, false}) {
      SCOPED_TRACE(compression);
      const Bytes file = rosbag_file(bag, {compression, 4, index});
      expect_same(bag, *rosbag(file));
    }
  }
}

/// Damage in a chunk without wanted topics is not even seen.
TEST(BagReader, OtherTopicsAreLeftOutAndTheirChunksNotOpened) {
  const WrittenBag bag = stereo_bag(MessageEncoding::kCdr);
  Bytes file = mcap_file(bag, {.chunk_messages = 1});
  const Bytes cloud(50, 1);
  const auto damaged = std::search(file.begin(), file.end(), cloud.begin(), cloud.end());
  ASSERT_NE(damaged, file.end());
  *damaged ^= 1;
  const auto reader = mcap(file);
  reader->select({reader->topics()[1].id});
  BagMessage next;
  int count = 0;
  for (; reader->next(next); ++count) EXPECT_EQ(next.topic, reader->topics()[1].id);
  EXPECT_EQ(count, kCount);
  reader->select(all_topics(*reader));
  EXPECT_IO_ERROR(reader->next(next), "some.mcap: a chunk is damaged: its checksum does not fit");
}

struct SomeFile {
  std::string name;
  Reader open;
  Bytes bytes;
};

std::vector<SomeFile> files_of_all_kinds() {
  std::vector<SomeFile> files;
  for (const std::size_t chunk : {0, 1, 4, 1000}) {
    for (const char* compression : {"", "zstd", "lz4"})
      files.push_back({fmt::format("mcap {} {}", compression, chunk), mcap,
                       mcap_file(stereo_bag(MessageEncoding::kCdr),
                                 {MessageEncoding::kCdr, compression, chunk, chunk != 4, true})});
    if (chunk == 0) continue;
    for (const char* compression : {"none", "bz2", "lz4"})
      files.push_back({fmt::format("rosbag {} {}", compression, chunk), rosbag,
                       rosbag_file(stereo_bag(MessageEncoding::kRos1), {compression, chunk, chunk != 4})});
  }
  return files;
}

/// In any order, and while others are read on.
TEST(BagReader, GivesAMessageAgainFromItsPlace) {
  for (const SomeFile& file : files_of_all_kinds()) {
    SCOPED_TRACE(file.name);
    const auto reader = file.open(file.bytes);
    reader->select(all_topics(*reader));
    std::vector<BagMessage> messages;
    std::vector<Bytes> data;
    ChunkMemory chunk;
    for (BagMessage next; reader->next(next);) {
      data.emplace_back(next.data.begin(), next.data.end());
      messages.push_back(next);
      const BagMessage first = reader->read_again(messages.front().place, chunk);
      EXPECT_EQ(Bytes(first.data.begin(), first.data.end()), data.front());
    }
    ASSERT_EQ(messages.size(), 5U * kCount);
    for (std::size_t n = messages.size(); n-- > 0;) {
      const BagMessage again = reader->read_again(messages[n].place, chunk);
      EXPECT_EQ(again.topic, messages[n].topic);
      EXPECT_EQ(again.t_ns, messages[n].t_ns);
      EXPECT_EQ(Bytes(again.data.begin(), again.data.end()), data[n]);
    }
  }
}

/// As when a file is written to while it is read: refused, or a message; what was asked before does not
/// matter.
TEST(BagReader, WhatHasChangedMeanwhileIsRefused) {
  std::mt19937 random(3);
  for (const SomeFile& file : files_of_all_kinds()) {
    SCOPED_TRACE(file.name);
    Bytes bytes = file.bytes;
    const auto reader = file.open(bytes);
    reader->select(all_topics(*reader));
    std::vector<MessagePlace> places;
    for (BagMessage next; reader->next(next);) places.push_back(next.place);
    int refused = 0;
    ChunkMemory chunk;
    for (int turn = 0; turn < 300; ++turn) {
      bytes = file.bytes;
      const MessagePlace& place = places[random() % places.size()];
      for (int n = 0; n < 8; ++n) {
        const std::size_t at = std::min<std::size_t>(place.record + random() % 60, bytes.size() - 1);
        bytes[at] = static_cast<std::uint8_t>(random());
      }
      chunk.record.reset();
      try {
        (void)reader->read_again(place, chunk);
      } catch (const IoError& error) {
        ++refused;
        EXPECT_NE(std::string(error.what()).find("(byte "), std::string::npos) << error.what();
        bytes = file.bytes;
        EXPECT_NO_THROW((void)reader->read_again(place, chunk));
      }
    }
    EXPECT_GT(refused, 30);
  }
}

/// Messages stand by themselves: a damaged summary costs a pass over the file, and is said.
TEST(BagReader, ADamagedSummaryIsSaidAndDoneWithout) {
  const WrittenBag bag = stereo_bag(MessageEncoding::kCdr);
  for (const bool checksums : {true, false}) {
    Bytes file = mcap_file(bag, {.chunk_messages = 2, .checksums = checksums});
    const std::size_t footer = file.size() - 8 - 4 - 8 - 8;  // its summary's place, and what follows
    for (const std::size_t at : {file.size() - 8 - 4 - 30, footer + 7}) {
      Bytes damaged = file;
      damaged[at] ^= 0x40;
      if (!checksums && at != footer + 7) continue;  // nothing tells that it is damaged
      const auto reader = mcap(damaged);
      ASSERT_EQ(reader->topics().size(), bag.topics.size());
      reader->select(all_topics(*reader));
      std::size_t messages = 0;
      for (BagMessage next; reader->next(next);) ++messages;
      EXPECT_EQ(messages, bag.messages.size());
      EXPECT_NE(reader->fault().find("some.mcap: the summary is "), std::string::npos) << reader->fault();
      EXPECT_NE(reader->fault().find("the whole file was read"), std::string::npos) << reader->fault();
    }
  }
}

/// As when its recorder was killed: what is whole is given, and the place named.
TEST(BagReader, AFileThatIsCutShortGivesWhatCameBefore) {
  const WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
  const auto count = [](BagReader& reader) {
    reader.select(all_topics(reader));
    BagMessage next;
    std::size_t messages = 0;
    while (reader.next(next)) ++messages;
    return messages;
  };
  const Bytes whole_mcap =
      mcap_file(bag, {.encoding = MessageEncoding::kRos1, .chunk_messages = 2, .summary = false});
  const Bytes cut_mcap(whole_mcap.begin(),
                       whole_mcap.begin() + static_cast<std::ptrdiff_t>(whole_mcap.size() * 2 / 3));
  const auto of_mcap = mcap(cut_mcap);
  const std::size_t from_mcap = count(*of_mcap);
  EXPECT_GT(from_mcap, bag.messages.size() / 2);
  EXPECT_LT(from_mcap, bag.messages.size());
  EXPECT_NE(of_mcap->fault().find("some.mcap: is cut short at byte"), std::string::npos);
  const Bytes whole_bag = rosbag_file(bag, {"none", 2, false});
  const Bytes cut_bag(whole_bag.begin(),
                      whole_bag.begin() + static_cast<std::ptrdiff_t>(whole_bag.size() * 2 / 3));
  const auto of_bag = rosbag(cut_bag);
  const std::size_t from_bag = count(*of_bag);
  EXPECT_GT(from_bag, bag.messages.size() / 2);
  EXPECT_LT(from_bag, bag.messages.size());
  EXPECT_NE(of_bag->fault().find("some.bag: is cut short at byte"), std::string::npos);
}

TEST(BagReader, SaysWhatIsWrong) {
  const Bytes text{'h', 'e', 'l', 'l', 'o'};
  EXPECT_IO_ERROR(mcap(text), "some.mcap: is no MCAP file");
  EXPECT_IO_ERROR(rosbag(text), "some.bag: is no bag of format 2.0");
  EXPECT_IO_ERROR(mcap({}), "is no MCAP file");
  EXPECT_IO_ERROR(open_mcap("/nowhere/at.all"), "/nowhere/at.all: no such file");
  const ScratchFolder scratch;
  EXPECT_IO_ERROR(open_rosbag(scratch.write("empty.bag", "")), "empty.bag: the file is empty");
  EXPECT_IO_ERROR(open_mcap(scratch.write("empty.mcap", "")), "empty.mcap: the file is empty");
  EXPECT_IO_ERROR(open_rosbag("/dev"), "/dev: is a folder, not a file");
  const WrittenBag bag = stereo_bag(MessageEncoding::kCdr);
  Bytes file = mcap_file(bag, {.compression = "zstd", .checksums = false});
  const std::string packer = "zstd";
  const auto name = std::search(file.begin(), file.end(), packer.begin(), packer.end());
  *name = 'x';
  const auto reader = mcap(file);
  reader->select({1});
  BagMessage next;
  EXPECT_IO_ERROR(reader->next(next), "a chunk of unknown compression 'xstd'");
}

/// Opens and reads all there is; false when that was refused.
bool read_all(const Reader& read, const Bytes& bytes) {
  try {
    const auto reader = read(bytes);
    reader->select(all_topics(*reader));
    BagMessage next;
    for (int n = 0; n < 10'000 && reader->next(next); ++n) {
    }
    return true;
  } catch (const IoError& error) {
    EXPECT_EQ(std::string(error.what()).find("some."), 0U) << error.what();
    return false;
  }
}

/// Whatever the bytes: an answer or an IoError, under the sanitizers nothing else. tests/fuzz goes on longer.
TEST(BagReader, DamagedFilesAreReadOrRefused) {
  std::mt19937 rng(3);
  const WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
  int read_files = 0, refused_files = 0;
  const auto damage = [&](const Reader& read, const Bytes& good) {
    for (int trial = 0; trial < 400; ++trial) {
      Bytes bad = good;
      if (trial % 4 == 0) bad.resize(rng() % bad.size());
      for (int n = 0; n < 1 + trial % 8; ++n) {
        if (!bad.empty()) bad[rng() % bad.size()] = static_cast<std::uint8_t>(rng());
      }
      // Sizes and places stand in the first bytes of records.
      if (bad.size() > 40) bad[8 + rng() % 32] = 0xFF;
      ++(read_all(read, bad) ? read_files : refused_files);
    }
  };
  for (const bool checksums : {true, false}) {
    for (const char* compression : {"", "zstd", "lz4"})
      damage(mcap, mcap_file(bag, {MessageEncoding::kRos1, compression, 3, true, checksums}));
  }
  for (const char* compression : {"none", "bz2", "lz4"}) damage(rosbag, rosbag_file(bag, {compression}));
  EXPECT_GT(read_files, 100) << "all that is damaged is refused";
  EXPECT_GT(refused_files, 100) << "all that is damaged is read";
}

}  // namespace
}  // namespace twofold
