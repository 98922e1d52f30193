#include "server/base/near_miss.h"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace trammel {
namespace {

constexpr std::size_t kMostChanges = 2;
constexpr std::size_t kLongest = 100;  // bytes; longer texts are no misspelled words

/// The least number of edits from `a` to `b`: a letter inserted, left out, changed, or swapped with
/// its neighbour.
std::size_t changes_between(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> least(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        least[i][j] = i + j;
        continue;
      }
      const std::size_t changed = least[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      least[i][j] = std::min({least[i - 1][j] + 1, least[i][j - 1] + 1, changed});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) least[i][j] = std::min(least[i][j], least[i - 2][j - 2] + 1);
    }
  }
  return least[a.size()][b.size()];
}

}  // namespace

std::string near_miss(std::string_view word, std::span<const std::string> known) {
  std::string nearest;
  std::size_t least = std::min(kMostChanges, word.empty() ? 0 : (word.size() - 1) / 2) + 1;
  if (word.size() > kLongest) return nearest;
  for (const std::string& one : known) {
    const std::size_t changes = changes_between(word, one);
    if (changes >= least) continue;
    least = changes;
    nearest = one;
  }
  return nearest;
}

std::string did_you_mean(std::string_view word, std::span<const std::string> known) {
  const std::string nearest = near_miss(word, known);
  return nearest.empty() ? "" : ", did you mean " + nearest + "?";
}

}  // namespace trammel
