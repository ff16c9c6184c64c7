// Feeds a fuzz target what libFuzzer would: each file of a folder, then inputs made from them and
// from random bytes, the same ones each time: 2000, 200 where SATEEN_SEEDS is few, or as many as the
// second argument says. Each input may take 10 s and 2 GB; what takes more is a finding.
#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <random>
#include <string>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::string;

constexpr unsigned kSecondsPerInput = 10;
constexpr rlim_t kMaxMemory = rlim_t{2} << 30;
constexpr const char* kFinding = "fuzz-finding";  // the input that ended the program

// Numbers at which arithmetic and sizes break.
constexpr std::array<std::string_view, 14> kNumbers = {"0",
                                                       "-1",
                                                       "1e308",
                                                       "-1e308",
                                                       "1e-308",
                                                       "1e30",
                                                       "2147483647",
                                                       "-0.0",
                                                       "65536",
                                                       "4294967296",
                                                       "18446744073709551616",
                                                       "1e999",
                                                       "0.5",
                                                       "null"};
constexpr std::array<std::uint32_t, 8> kSizes = {0,       1,          0x7F,       0xFFFF,
                                                 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF};

Bytes current;  // for the finding's file

// Keeps the input in a file, with calls that a signal handler may make.
void KeepFinding(int signal_number) {
  std::signal(signal_number, SIG_DFL);
  const int file = open(kFinding, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  static_cast<void>(!write(file, current.data(), current.size()));
  std::raise(signal_number);
}

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

// Puts another number where one stands in text.
void ChangeNumber(Bytes& bytes, std::mt19937& random) {
  const auto is_digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  const auto begin =
      std::find_if(bytes.begin() + static_cast<std::ptrdiff_t>(random() % (bytes.size() + 1)),
                   bytes.end(), is_digit);
  const auto end = std::find_if_not(begin, bytes.end(), [&](char c) {
    return is_digit(c) || std::string_view(".eE+-").find(c) != std::string_view::npos;
  });
  const std::string_view number = kNumbers[random() % kNumbers.size()];
  bytes.replace(begin, end, number.begin(), number.end());
}

// Puts a size of four bytes where binary formats may have one.
void ChangeSize(Bytes& bytes, std::mt19937& random) {
  if (bytes.size() < 4) {
    return;
  }
  const std::size_t at = random() % (bytes.size() - 3);
  const std::uint32_t size = kSizes[random() % kSizes.size()];
  const bool big_endian = random() % 2 == 0;
  for (std::size_t i = 0; i < 4; ++i) {
    bytes[at + i] = static_cast<char>(size >> 8 * (big_endian ? 3 - i : i));
  }
}

// Flips, drops, inserts, repeats and cuts: up to three changes.
Bytes Mutated(Bytes bytes, std::mt19937& random) {
  for (auto changes = random() % 4; changes > 0; --changes) {
    const auto byte = static_cast<char>(random());
    const std::size_t at = random() % (bytes.size() + 1);
    switch (random() % 8) {
      case 0:
      case 1:
        bytes.insert(at, 1, byte);
        break;
      case 2:
        bytes.erase(at, 1 + random() % 8);
        break;
      case 3:
        ChangeNumber(bytes, random);
        break;
      case 4:
        ChangeSize(bytes, random);
        break;
      case 5:
        bytes.insert(at, bytes.substr(random() % (bytes.size() + 1), random() % 64));
        break;
      case 6:
        bytes.resize(random() % 8 == 0 ? at : bytes.size());
        break;
      default:
        if (at < bytes.size()) {
          bytes[at] = static_cast<char>(bytes[at] ^ byte);
        }
    }
  }
  return bytes;
}

void Feed(Bytes bytes) {
  current = std::move(bytes);
  alarm(kSecondsPerInput);
  LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(current.data()), current.size());
}

// Ends the program at the first input that takes too much. The address sanitizer reports by itself
// what else is fatal, and reserves far more memory than it uses.
void SetLimits() {
  std::signal(SIGALRM, KeepFinding);
#if !defined(__SANITIZE_ADDRESS__)
  for (const int fatal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGILL}) {
    std::signal(fatal, KeepFinding);
  }
  const rlimit limit = {kMaxMemory, kMaxMemory};
  setrlimit(RLIMIT_AS, &limit);
#endif
}

int Rounds(int argc, char** argv) {
  int rounds = 2000;
  if (argc > 2) {
    const std::string_view text = argv[2];
    std::from_chars(text.data(), text.data() + text.size(), rounds);
  } else if (const char* seeds = std::getenv("SATEEN_SEEDS");
             seeds != nullptr && std::string_view(seeds) == "few") {
    rounds = 200;
  }
  return rounds;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 && argc != 3) {
    std::cerr << "usage: run_corpus FOLDER [ROUNDS]\n";
    return 2;
  }
  const std::vector<Bytes> corpus = ReadCorpus(argv[1]);
  if (corpus.empty()) {
    std::cerr << argv[1] << ": no files; a corpus needs at least one\n";
    return 3;
  }
  SetLimits();
  for (const Bytes& bytes : corpus) {
    Feed(bytes);
  }
  const int rounds = Rounds(argc, argv);
  std::mt19937 random(1);
  for (int round = 0; round < rounds; ++round) {
    Bytes bytes = Mutated(corpus[random() % corpus.size()], random);
    if (round % 8 == 0) {
      bytes.resize(random() % 300);
      std::ranges::generate(bytes, [&] { return static_cast<char>(random()); });
    }
    Feed(std::move(bytes));
  }
  std::cout << corpus.size() << " files and " << rounds << " inputs made from them\n";
  return 0;
}
