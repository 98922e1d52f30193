#include "server/error_sources/cause_words.h"

#include <sstream>

#include "server/error_sources/spelling.h"

namespace trammel {

std::string causes_in_words(const std::vector<std::string>& spellings) {
  std::string list;
  for (const std::string& spelling : spellings)
    list += (list.empty() ? "" : ", ") + in_words(spelling);
  return list;
}

std::string level_in_words(const std::string& level) {
  std::vector<std::string> spellings;
  std::istringstream words(level);
  for (std::string word; std::getline(words, word, ',');) spellings.push_back(word);
  return spellings.empty() ? "none" : causes_in_words(spellings);
}

}  // namespace trammel
