// Feeds a fuzz target what libFuzzer would: each file of a folder, then 2000 inputs made from them
// and from random bytes, the same ones each time; 200 where SATEEN_SEEDS is few.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <random>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Bytes> ReadCorpus(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    paths.push_back(entry.path());
  }
  std::ranges::sort(paths);
  std::vector<Bytes> corpus;
  for (const std::filesystem::path& path : paths) {
    std::ifstream file(path, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return corpus;
}

// Flips, drops and inserts up to three bytes.
Bytes Mutated(Bytes bytes, std::mt19937& random) {
  for (auto changes = random() % 4; changes > 0; --changes) {
    const auto byte = static_cast<std::uint8_t>(random());
    const auto at = static_cast<std::ptrdiff_t>(random() % (bytes.size() + 1));
    if (at == static_cast<std::ptrdiff_t>(bytes.size()) || random() % 3 == 0) {
      bytes.insert(bytes.begin() + at, byte);
    } else if (random() % 2 == 0) {
      bytes.erase(bytes.begin() + at);
    } else {
      bytes[static_cast<std::size_t>(at)] ^= byte;
    }
  }
  return bytes;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: run_corpus FOLDER\n";
    return 2;
  }
  const std::vector<Bytes> corpus = ReadCorpus(argv[1]);
  if (corpus.empty()) {
    std::cerr << argv[1] << ": no files; a corpus needs at least one\n";
    return 3;
  }
  for (const Bytes& bytes : corpus) {
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
  const char* seeds = std::getenv("SATEEN_SEEDS");
  const int rounds = seeds != nullptr && std::string_view(seeds) == "few" ? 200 : 2000;
  std::mt19937 random(1);
  for (int round = 0; round < rounds; ++round) {
    Bytes bytes = Mutated(corpus[random() % corpus.size()], random);
    if (round % 4 == 0) {
      bytes.resize(random() % 300);
      std::ranges::generate(bytes, [&] { return static_cast<std::uint8_t>(random()); });
    }
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
  std::cout << corpus.size() << " files and " << rounds << " inputs made from them\n";
  return 0;
}
