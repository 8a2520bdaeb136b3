#include <array>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

#include "base/bytes.hpp"
#include "base/checksum.hpp"
#include "loopclosure/vocabulary.hpp"

namespace twofold {
namespace {

constexpr std::array<char, 8> kMagic{'T', 'F', 'V', 'O',
                                     'C', 0,   0,   1};  // the last byte is the format's version
constexpr std::size_t kNodeBytes = 32 + 4 + 4;
constexpr std::size_t kHeaderBytes = kMagic.size() + 4;
constexpr std::uint32_t kMaxNodes = 1U << 22;

}  // namespace

void Vocabulary::save(const std::filesystem::path& file) const {
  ByteWriter bytes;
  for (const char c : kMagic) bytes.put(c);
  bytes.put(static_cast<std::uint32_t>(nodes_.size()));
  for (const Node& node : nodes_) {
    for (const std::uint64_t bits : node.descriptor.bits) bytes.put(bits);
    bytes.put(node.child_count);  // first children follow from the counts, words from the order of the leaves
    bytes.put(node.idf);
  }
  bytes.put(crc32_of(bytes.bytes()));
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.bytes().data()), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) throw std::runtime_error(file.string() + ": cannot be written");
}

Vocabulary Vocabulary::parse(std::span<const std::uint8_t> bytes, const std::string& name) {
  const auto fail = [&](const char* what) -> Vocabulary { throw std::runtime_error(name + ": " + what); };
  if (bytes.size() < kHeaderBytes + 4) return fail("too short to be a vocabulary");
  if (std::memcmp(bytes.data(), kMagic.data(), kMagic.size() - 1) != 0) return fail("not a vocabulary file");
  if (bytes[kMagic.size() - 1] != static_cast<std::uint8_t>(kMagic.back())) {
    return fail("vocabulary of another format version");
  }
  ByteReader in(bytes.subspan(kMagic.size()));
  const std::uint32_t count = in.u32();
  if (count > kMaxNodes || bytes.size() != kHeaderBytes + std::size_t{count} * kNodeBytes + 4) {
    return fail("header: size does not fit the number of nodes");
  }
  if (ByteReader(bytes.last(4)).u32() != crc32_of(bytes.first(bytes.size() - 4)))
    return fail("checksum is wrong, the file is damaged");
  std::vector<Node> nodes(count);
  std::uint32_t next_child = 1;
  WordId next_word = 0;
  for (Node& node : nodes) {
    for (std::uint64_t& bits : node.descriptor.bits) bits = in.u64();
    node.child_count = in.u32();
    node.idf = in.number<float>();
    if (node.child_count > count) return fail("nodes: a child count is too large");
    if (node.child_count > 0) {
      node.first_child = next_child;
      next_child += node.child_count;
      if (next_child > count) return fail("nodes: more children than nodes");
    } else {
      node.word = next_word++;
    }
  }
  try {
    return Vocabulary(std::move(nodes));
  } catch (const std::runtime_error& error) {
    return fail(error.what());
  }
}

Vocabulary Vocabulary::load(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(file.string() + ": cannot be opened");
  std::error_code error;
  const auto size = std::filesystem::file_size(file, error);
  if (error) throw std::runtime_error(file.string() + ": is not a file of bytes: " + error.message());
  if (size > kHeaderBytes + std::size_t{kMaxNodes} * kNodeBytes + 4) {
    throw std::runtime_error(file.string() + ": too large to be a vocabulary");
  }
  std::vector<std::uint8_t> bytes(size);
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!in) throw std::runtime_error(file.string() + ": cannot be read");
  return parse(bytes, file.string());
}

}  // namespace twofold
