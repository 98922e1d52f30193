#include "server/bias/kernel_spelling.h"

#include <algorithm>
#include <cctype>
#include <utility>
#include <vector>

namespace trammel {
namespace {

constexpr int kMostDepth = 20;  // of parentheses; nobody means more, and the stack ends somewhere

bool is_of_word(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// sum = product {"+" product};  product = factor {"*" factor};  factor = "(" sum ")" | word ["(" "sincos" ")"].
class Reader {
 public:
  explicit Reader(std::string_view spelling) : all_(spelling), rest_(spelling) {}

  Result<KernelPtr> whole() {
    auto kernel = list(
        '+', [this] { return product(); }, sum_of);
    skip_space();
    if (kernel && !rest_.empty()) return expected("`+`, `*` or the end");
    return kernel;
  }

 private:
  template <typename Part>
  Result<KernelPtr> list(char separator, const Part& part, KernelPtr (*join)(std::vector<KernelPtr>)) {
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
    if (++depth_ > kMostDepth) return refused("bias kernel `{}`: more than {} parentheses deep", all_, kMostDepth);
    auto inside = list(
        '+', [this] { return product(); }, sum_of);
    if (inside && !take(')')) return expected("`)`");
    --depth_;
    return inside;
  }

  Result<KernelPtr> leaf() {
    const std::string_view name = word();
    if (name.empty()) return expected("a kernel");
    KernelPtr kernel = make_leaf_kernel(name);
    if (!kernel)
      return refused("bias kernel `{}`: `{}` is unknown; known are none (alone), {}", all_, name, kernel_names());
    if (!take('(')) return kernel;
    if (word() != "sincos" || !take(')')) return expected(fmt::format("`{}(sincos)`", name));
    return make_sincos_kernel(std::move(kernel));
  }

  tl::unexpected<Error> expected(std::string_view what) const {
    return refused("bias kernel `{}`, character {}: {} is expected", all_, all_.size() - rest_.size() + 1, what);
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
  int depth_ = 0;
};

}  // namespace

Result<KernelPtr> spelled_kernel(std::string_view spelling) { return Reader(spelling).whole(); }

}  // namespace trammel
