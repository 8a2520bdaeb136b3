#include <zlib.h>
#include <array>
#include <bit>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

#include "loopclosure/vocabulary.hpp"

namespace twofold {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the file is little-endian; other machines need a swap");

constexpr std::array<char, 8> kMagic{'T', 'F', 'V', 'O',
                                     'C', 0,   0,   1};  // the last byte is the format's version
constexpr std::size_t kNodeBytes = 32 + 4 + 4;
constexpr std::size_t kHeaderBytes = kMagic.size() + 4;
constexpr std::uint32_t kMaxNodes = 1U << 22;

template <class T>
void put(std::vector<std::uint8_t>& bytes, const T& value) {
  const auto* p = reinterpret_cast<const std::uint8_t*>(&value);
  bytes.insert(bytes.end(), p, p + sizeof(T));
}

template <class T>
T get(std::span<const std::uint8_t> bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

std::uint32_t checksum(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(crc32(0, bytes.data(), static_cast<uInt>(bytes.size())));
}

}  // namespace

void Vocabulary::save(const std::filesystem::path& file) const {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(kHeaderBytes + nodes_.size() * kNodeBytes + 4);
  for (const char c : kMagic) bytes.push_back(static_cast<std::uint8_t>(c));
  put(bytes, static_cast<std::uint32_t>(nodes_.size()));
  for (const Node& node : nodes_) {
    put(bytes, node.descriptor.bits);
    put(bytes,
        node.child_count);  // first children follow from the counts, words from the order of the leaves
    put(bytes, node.idf);
  }
  put(bytes, checksum(bytes));
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
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
  const auto count = get<std::uint32_t>(bytes, kMagic.size());
  if (count > kMaxNodes || bytes.size() != kHeaderBytes + std::size_t{count} * kNodeBytes + 4) {
    return fail("header: size does not fit the number of nodes");
  }
  if (get<std::uint32_t>(bytes, bytes.size() - 4) != checksum(bytes.first(bytes.size() - 4))) {
    return fail("checksum is wrong, the file is damaged");
  }
  std::vector<Node> nodes(count);
  std::uint32_t next_child = 1;
  WordId next_word = 0;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t at = kHeaderBytes + n * kNodeBytes;
    nodes[n].descriptor.bits = get<std::array<std::uint64_t, 4>>(bytes, at);
    nodes[n].child_count = get<std::uint32_t>(bytes, at + 32);
    nodes[n].idf = get<float>(bytes, at + 36);
    if (nodes[n].child_count > count) return fail("nodes: a child count is too large");
    if (nodes[n].child_count > 0) {
      nodes[n].first_child = next_child;
      next_child += nodes[n].child_count;
      if (next_child > count) return fail("nodes: more children than nodes");
    } else {
      nodes[n].word = next_word++;
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
