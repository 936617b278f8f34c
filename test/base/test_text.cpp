// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <random>
#include <set>

#include "dynid/base/error.hpp"
#include "dynid/base/text.hpp"
#include "model/xml_index.hpp"

namespace dynid {
namespace {

/// Bytes of every kind but zero, the ones that matter to an escape more often than the rest.
std::string any_text(std::mt19937_64& random, bool printable_only) {
  constexpr char pointed[] = "&<>\"'\\$`!; \n\t/-";
  std::string text;
  for (std::size_t k = random() % 40; k > 0; --k) {
    if (random() % 2 == 0)
      text += pointed[random() % (sizeof pointed - 1)];
    else
      text += static_cast<char>(printable_only ? 0x20 + random() % 0x5f : 1 + random() % 0x7f);
  }
  return text;
}

TEST(Text, Joins) {
  EXPECT_EQ(join(std::vector<std::string>{}), "");
  EXPECT_EQ(join(std::vector<std::string>{"", "b"}), ", b");
  EXPECT_EQ(join(std::set<std::string>{"b", "a"}, " or "), "a or b");
  EXPECT_EQ(list_in_words({}), "");
  EXPECT_EQ(list_in_words({"a"}), "a");
  EXPECT_EQ(list_in_words({"a", "b"}), "a and b");
  EXPECT_EQ(list_in_words({"a", "b", "c"}), "a, b and c");
  EXPECT_EQ(with_spaces("load_dependent_friction"), "load dependent friction");
  EXPECT_EQ(capitalised("gap"), "Gap");
  EXPECT_EQ(capitalised("\u00fcber"), "\u00fcber");
  EXPECT_EQ(capitalised(""), "");
}

TEST(Text, AnErrorIsOneLineWhateverItQuotes) {
  EXPECT_STREQ(Error("a: b\r\nc\t\n").what(), "a: b  c");
  EXPECT_STREQ(Error("\n").what(), "");
}

TEST(Text, OneLineIsOneLine) {
  EXPECT_EQ(one_line("a: b\r\nc\t\n"), "a: b  c");
  EXPECT_EQ(one_line("\u00e9\x7f!"), "\u00e9 !");
  EXPECT_EQ(one_line("\n"), "");
}

// A parser that is not ours reads back what was escaped.
TEST(Text, XmlReadsBackWhatWasEscaped) {
  std::mt19937_64 random(21);
  for (int k = 0; k < 500; ++k) {
    std::string text = any_text(random, true);
    text.erase(std::remove_if(text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t'; }),
               text.end());
    const auto elements = detail::index_xml("<a b=\"" + xml_escaped(text) + "\"/>", "a.xml");
    ASSERT_EQ(elements.size(), 1u);
    ASSERT_EQ(elements[0].attribute("b"), text) << text;
  }
}

TEST(Text, HtmlLeavesControlCharactersOut) {
  EXPECT_EQ(html_escaped("<b a=\"1\">\x01&\n\t</b>"), "&lt;b a=&quot;1&quot;&gt;&amp;\n\t&lt;/b&gt;");
}

TEST(Text, JsonInAScriptIsTheSameJsonAndEndsNoScript) {
  std::mt19937_64 random(22);
  for (int k = 0; k < 500; ++k) {
    const nlohmann::json json = {{any_text(random, false), {any_text(random, false) + "</script><!--", 1.5}}};
    const std::string escaped = script_escaped(json.dump());
    ASSERT_EQ(escaped.find('<'), std::string::npos) << escaped;
    ASSERT_EQ(nlohmann::json::parse(escaped), json);
  }
}

TEST(Text, AShellReadsBackWhatWasQuoted) {
  EXPECT_EQ(shell_quoted("a/b-1.csv"), "a/b-1.csv");
  EXPECT_EQ(shell_quoted(""), "''");
  EXPECT_EQ(shell_quoted("it's"), "'it'\\''s'");
  std::mt19937_64 random(23);
  std::string command = "printf '%s\\001'", expected;
  for (int k = 0; k < 100; ++k) {
    std::string word = any_text(random, false);
    word.erase(std::remove(word.begin(), word.end(), '\x01'), word.end());
    command += " " + shell_quoted(word);
    expected += word + "\x01";
  }
  FILE* shell = popen(command.c_str(), "r");
  ASSERT_NE(shell, nullptr);
  std::string read;
  for (int c = std::fgetc(shell); c != EOF; c = std::fgetc(shell)) read += static_cast<char>(c);
  pclose(shell);
  EXPECT_EQ(read, expected);
}

}  // namespace
}  // namespace dynid
