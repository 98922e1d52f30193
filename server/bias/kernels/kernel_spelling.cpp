#include "server/bias/kernels/kernel_spelling.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>
#include <vector>

#include "server/base/plain_text.h"

namespace trammel {
namespace {

constexpr int kMostParentheses = 20;  // inside one another: reading recurses, and nobody means more
constexpr std::size_t kMostSpellingBytes = 1000;  // longer than any 32 words
constexpr std::size_t kMostShownBytes = 80;       // of a spelling in a message
constexpr std::size_t kMostWords =
    32;  // the search for their hyperparameters takes more than twice the time for twice as many

constexpr std::string_view kFlange = "flange";

const std::array<LinearBlockPtr, 2>& known_blocks() {
  static const std::array<LinearBlockPtr, 2> known = {make_joint_map_block(),
                                                      make_parameter_block()};
  return known;
}

LinearBlockPtr find_block(std::string_view word) {
  for (const LinearBlockPtr& block : known_blocks()) {
    if (block->name() == word) return block;
  }
  return nullptr;
}

bool is_of_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// bias = term {"+" term};  term = block | product;
// sum = product {"+" product};  product = factor {"*" factor};  factor = "(" sum ")" | word ["("
// "sincos" ")"].
class Reader {
 public:
  explicit Reader(std::string_view spelling)
      : all_(spelling), rest_(spelling), shown_(shown_short(spelling, kMostShownBytes)) {}

  Result<KernelPtr> whole() {
    auto kernel = list(
        '+', [this] { return product(); }, sum_of);
    skip_space();
    if (kernel && !rest_.empty()) return expected("`+`, `*` or the end");
    return kernel;
  }

  Result<SpelledBias> bias() {
    std::vector<KernelPtr> parts;
    SpelledBias bias;
    do {
      const std::string_view before = rest_;
      const std::string_view first = word();
      if (first == kFlange) {
        if (bias.flange) return twice(kFlange);
        if (take('*') || take('(')) return misplaced(kFlange);
        bias.flange = true;
        continue;
      }
      const LinearBlockPtr block = find_block(first);
      if (!block) {
        rest_ = before;
        auto part = product();
        if (!part) return tl::make_unexpected(part.error());
        parts.push_back(*std::move(part));
        continue;
      }
      if (bias.has(block->name())) return twice(block->name());
      if (take('*') || take('(')) return misplaced(block->name());
      bias.blocks.push_back(block);
    } while (take('+'));
    skip_space();
    if (!rest_.empty()) return expected("`+`, `*` or the end");
    if (bias.flange && !bias.blocks.empty())
      return refused(
                 "bias kernel `{}`: `flange` and `{}` do not stand together; the block sees levers "
                 "by itself",
                 shown_, bias.blocks.front()->name())
          .of("bias")
          .with_text(all_);
    if (parts.empty()) {
      const std::string_view block = bias.flange ? kFlange : bias.blocks.front()->name();
      return refused("bias kernel `{}`: a kernel is expected beside `{}`, for instance `se + {}`",
                     shown_, block, block)
          .of("bias")
          .with_text(all_);
    }
    bias.kernel = parts.size() == 1 ? parts.front() : sum_of(std::move(parts));
    return bias;
  }

 private:
  template <typename Part>
  Result<KernelPtr> list(char separator, const Part& part,
                         KernelPtr (*join)(std::vector<KernelPtr>)) {
    std::vector<KernelPtr> parts;
    do {
      auto next = part();
      if (!next) return next;
      parts.push_back(*std::move(next));
    } while (take(separator));
    return parts.size() == 1 ? parts.front() : join(std::move(parts));
  }

  Result<KernelPtr> product() {
    return list(
        '*', [this] { return factor(); }, product_of);
  }

  Result<KernelPtr> factor() {
    if (!take('(')) return leaf();
    if (++depth_ > kMostParentheses)
      return refused("bias kernel `{}`: more than {} parentheses deep", shown_, kMostParentheses)
          .of("bias")
          .with_text(all_)
          .beyond(depth_, kMostParentheses);
    auto inside = list(
        '+', [this] { return product(); }, sum_of);
    if (inside && !take(')')) return expected("`)`");
    --depth_;
    return inside;
  }

  Result<KernelPtr> leaf() {
    const std::string_view name = word();
    if (name.empty()) return expected("a kernel");
    if (name == kFlange || find_block(name)) return misplaced(name);
    KernelPtr kernel = make_leaf_kernel(name);
    if (!kernel)
      return refused("bias kernel `{}`: `{}` is unknown", shown_, shown_short(name))
          .of("bias")
          .with_text(name)
          .next(fmt::format(
              "known are none and auto (alone), {}, and to be added joint_map, parameters, flange",
              kernel_names()));
    if (!take('(')) return kernel;
    if (word() != "sincos" || !take(')')) return expected(fmt::format("`{}(sincos)`", name));
    return make_sincos_kernel(std::move(kernel));
  }

  Failure twice(std::string_view word) const {
    return refused("bias kernel `{}`: `{}` is named twice", shown_, word)
        .of("bias")
        .with_text(all_);
  }

  Failure misplaced(std::string_view block) const {
    return refused("bias kernel `{}`: `{}` can only be added to a whole bias, as in `se + {}`",
                   shown_, block, block)
        .of("bias")
        .with_text(all_);
  }

  Failure expected(std::string_view what) const {
    return refused("bias kernel `{}`, character {}: {} is expected", shown_,
                   all_.size() - rest_.size() + 1, what)
        .of("bias")
        .with_text(all_)
        .with_value(all_.size() - rest_.size() + 1);
  }

  void skip_space() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }

  bool take(char wanted) {
    skip_space();
    if (rest_.empty() || rest_.front() != wanted) return false;
    rest_.remove_prefix(1);
    return true;
  }

  std::string_view word() {
    skip_space();
    const auto end = std::find_if_not(rest_.begin(), rest_.end(), is_of_word);
    const std::string_view found = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
    rest_.remove_prefix(found.size());
    return found;
  }

  std::string_view all_;
  std::string_view rest_;
  std::string shown_;  // all_, as messages quote it
  int depth_ = 0;
};

}  // namespace

namespace {

/// This check comes first, so that nothing is built from a spelling that is too long.
Status check_length(std::string_view spelling) {
  if (spelling.size() > kMostSpellingBytes) {
    return failure(ErrorCode::kTooLarge, "bias kernel: {} bytes, limit {}", spelling.size(),
                   kMostSpellingBytes)
        .of("bias")
        .beyond(spelling.size(), kMostSpellingBytes);
  }
  const auto joins =
      std::count_if(spelling.begin(), spelling.end(), [](char c) { return c == '+' || c == '*'; });
  if (const auto words = static_cast<std::size_t>(joins) + 1; words > kMostWords) {
    return failure(ErrorCode::kTooLarge, "bias kernel `{}`: {} kernels, limit {}",
                   shown_short(spelling, kMostShownBytes), words, kMostWords)
        .of("bias")
        .with_text(spelling)
        .beyond(words, kMostWords);
  }
  return {};
}

}  // namespace

Result<KernelPtr> spelled_kernel(std::string_view spelling) {
  return check_length(spelling).and_then([&] { return Reader(spelling).whole(); });
}

bool SpelledBias::has(std::string_view block) const {
  return std::any_of(blocks.begin(), blocks.end(),
                     [&](const LinearBlockPtr& one) { return one->name() == block; });
}

Result<SpelledBias> spelled_bias(std::string_view spelling) {
  return check_length(spelling).and_then([&] { return Reader(spelling).bias(); });
}

std::string without_flange(std::string_view spelling) {
  std::string rest;
  while (!spelling.empty()) {
    const std::size_t end = std::min(spelling.find('+'), spelling.size());
    std::string_view part = spelling.substr(0, end);
    part.remove_prefix(std::min(part.find_first_not_of(" \t"), part.size()));
    part = part.substr(0, part.find_last_not_of(" \t") + 1);
    spelling.remove_prefix(std::min(end + 1, spelling.size()));
    if (part != kFlange) rest.append(rest.empty() ? "" : " + ").append(part);
  }
  return rest;
}

Status check_bias_spelling(std::string_view spelling) {
  if (spelling == "none" || spelling == "auto") return {};
  return spelled_bias(spelling).map([](const SpelledBias&) {});
}

}  // namespace trammel
