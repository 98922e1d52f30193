// Targets for clang's libFuzzer; the environment variable TRAMMEL_FUZZ_TARGET names one.
#include <cctype>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "server/base/check.h"
#include "server/base/plain_text.h"
#include "tests/fuzz/target.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

namespace trammel::fuzz {

std::string words_of(const Error& error) {
  const std::string said = sentence(error);
  TRAMMEL_CHECK(is_plain_lines(said));
  return said;
}

namespace {

const Target& chosen() {
  static const Target& target = []() -> const Target& {
    const char* name = std::getenv("TRAMMEL_FUZZ_TARGET");
    for (const Target& one : targets()) {
      if (name != nullptr && std::strcmp(name, one.name) == 0) return one;
    }
    fmt::print(stderr, "TRAMMEL_FUZZ_TARGET names no target\n");
    std::exit(2);
  }();
  return target;
}

}  // namespace
}  // namespace trammel::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static_cast<void>(trammel::fuzz::chosen().run({reinterpret_cast<const char*>(data), size}));
  return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned int seed) {
  const trammel::fuzz::Target& target = trammel::fuzz::chosen();
  trammel::fuzz::Random random(seed);
  std::string input(reinterpret_cast<const char*>(data), size);
  if (input.empty() && target.seeds != nullptr) input = target.seeds().front();
  if (random() % 4 == 0) {
    input.resize(max_size);
    input.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(input.data()), size, max_size));
    if (target.mutate == trammel::fuzz::mutate_model)
      input = trammel::fuzz::with_fitting_hashes(input);
  } else {
    input = target.mutate(input, random, max_size);
  }
  input.resize(std::min(input.size(), max_size));
  std::memcpy(data, input.data(), input.size());
  return input.size();
}
