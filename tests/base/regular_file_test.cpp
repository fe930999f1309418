// SPDX-License-Identifier: BSD-3-Clause
#include "base/regular_file.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "support/nobody.hpp"
#include "support/session_folder.hpp"
#include "trifinger/base/error.hpp"

// The watchdog of the suite ends a hang.

namespace trifinger {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class RegularFile : public ::testing::Test {
 protected:
  // Returns the error from opening `path`, as text. Its number goes to `number_`.
  std::string refusal(const std::filesystem::path& path, int flags, NamedBy named_by) {
    number_ = 0;
    try {
      ::close(open_regular_file(path, flags, named_by, 0600));
    } catch (const SystemError& error) {
      number_ = error.error_number();
      return error.what();
    }
    return "";
  }

  [[nodiscard]] std::filesystem::path file(const std::string& text = "text") const {
    std::ofstream(folder_.path() / "file") << text;
    return folder_.path() / "file";
  }
  [[nodiscard]] std::filesystem::path fifo() const {
    const std::filesystem::path path = folder_.path() / "fifo";
    EXPECT_EQ(::mkfifo(path.c_str(), 0666), 0);
    return path;
  }
  [[nodiscard]] std::filesystem::path link_to(const std::filesystem::path& target) const {
    std::filesystem::create_symlink(target, folder_.path() / "link");
    return folder_.path() / "link";
  }

  test::SessionFolder folder_;  // any folder of its own will do
  int number_{0};
};

constexpr int kWays[]{O_RDONLY, O_RDWR, O_WRONLY, O_RDWR | O_CREAT};

TEST_F(RegularFile, fault_73_AFifoIsRefusedAtOnceHoweverItIsOpened) {
  const std::filesystem::path path = fifo();
  for (const int flags : kWays) {
    for (const NamedBy named_by : {NamedBy::kUser, NamedBy::kProgram}) {
      EXPECT_THAT(refusal(path, flags, named_by), AllOf(HasSubstr(path), HasSubstr("a FIFO of")));
      EXPECT_EQ(number_, EINVAL);
    }
  }
  EXPECT_THAT(refusal(path, O_RDONLY, NamedBy::kProgram), HasSubstr("remove it, or choose"));
}

TEST_F(RegularFile, fault_73_FoldersDevicesAndSocketsAreRefusedByTheirKind) {
  for (const int flags : kWays) {
    EXPECT_THAT(refusal(folder_.path(), flags, NamedBy::kUser), HasSubstr("a folder of"));
    EXPECT_EQ(number_, EISDIR);
    EXPECT_THAT(refusal("/dev/zero", flags, NamedBy::kUser), HasSubstr("a device of user root"));
  }
  const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  const std::string path = folder_.path() / "socket";
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  ASSERT_EQ(::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  EXPECT_THAT(refusal(path, O_RDWR, NamedBy::kProgram), HasSubstr("a socket of"));
  ::close(socket);
}

TEST_F(RegularFile, fault_73_ALinkIsFollowedOnlyForAUserWhoNamedIt) {
  const std::filesystem::path path = link_to(file());
  for (const int flags : kWays) {
    EXPECT_EQ(refusal(path, flags, NamedBy::kUser), "");
    EXPECT_THAT(refusal(path, flags, NamedBy::kProgram), HasSubstr("a symbolic link of"));
    EXPECT_EQ(number_, ELOOP);
  }
  // The link is not followed to create a file either.
  std::filesystem::remove(folder_.path() / "file");
  EXPECT_NE(refusal(path, O_RDWR | O_CREAT, NamedBy::kProgram), "");
  EXPECT_NE(refusal(path, O_RDWR | O_CREAT | O_EXCL, NamedBy::kProgram), "");
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "file"));
}

TEST_F(RegularFile, fault_73_AFileOfAnotherUserIsRefusedForTheProgramAndServesTheUser) {
  if (!test::may_become_nobody()) GTEST_SKIP() << "only the administrator can become nobody";
  const std::filesystem::path path = file();
  std::filesystem::permissions(folder_.path(), std::filesystem::perms::all);
  std::filesystem::permissions(path, std::filesystem::perms::all);
  ASSERT_EQ(::chown(path.c_str(), 12345, 12345), 0);
  // The administrator trusts no other user. Other users do not trust each other.
  EXPECT_THAT(refusal(path, O_RDWR, NamedBy::kProgram),
              AllOf(HasSubstr(path), HasSubstr("of user 12345"), HasSubstr("none of your groups")));
  EXPECT_EQ(number_, EPERM);
  EXPECT_EQ(refusal(path, O_RDWR, NamedBy::kUser), "");
  test::ChildProcess other_user([&] {
    test::become_nobody();
    return refusal(path, O_RDWR, NamedBy::kProgram).empty() ? 1 : 0;
  });
  EXPECT_EQ(other_user.wait(), 0);
  test::ChildProcess member([&] {
    test::become_nobody(12345);
    return refusal(path, O_RDWR, NamedBy::kProgram).empty() ? 0 : 1;
  });
  EXPECT_EQ(member.wait(), 0);
}

TEST_F(RegularFile, ThatIsNotThereIsAnErrorOfTheSystem) {
  const std::string path = folder_.path() / "none";
  EXPECT_EQ(refusal(path, O_RDONLY, NamedBy::kUser),
            "open " + path + ": No such file or directory");
  EXPECT_EQ(number_, ENOENT);
}

TEST_F(RegularFile, IsReadAsAWhole) {
  EXPECT_EQ(read_file(file("some text"), 100), "some text");
  EXPECT_EQ(read_file(file(""), 0), "");
  const std::string large(200'000, 'x');
  EXPECT_EQ(read_file(file(large), large.size()), large);
  // Files in /proc have a size of 0 although they can be read.
  EXPECT_NE(read_file("/proc/self/stat", 10'000), "");
}

TEST_F(RegularFile, IsNotReadIfItIsLargerThanAllowed) {
  try {
    static_cast<void>(read_file(file("some text"), 8));
    FAIL();
  } catch (const SystemError& error) {
    EXPECT_EQ(error.error_number(), EFBIG);
    EXPECT_THAT(error.what(), HasSubstr("more than the 8 bytes"));
  }
}

TEST_F(RegularFile, IsMadeAnewAndReplacesNothing) {
  const std::filesystem::path path = folder_.path() / "new";
  const std::string text = "content";
  const auto bytes = std::as_bytes(std::span(text));
  write_new_file(path, bytes);
  EXPECT_EQ(read_file(path, 100), text);
  EXPECT_THROW(write_new_file(path, bytes), SystemError);
  EXPECT_THROW(write_new_file(fifo(), bytes), SystemError);
  EXPECT_THROW(write_new_file(link_to(folder_.path() / "elsewhere"), bytes), SystemError);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "elsewhere"));
}

TEST_F(RegularFile, IsReplacedAsAWholeAndKeepsItsMode) {
  const std::string text = "after";
  for (const mode_t mode : {0600U, 0640U, 0666U}) {
    const std::filesystem::path path = file("before");
    ASSERT_EQ(::chmod(path.c_str(), mode), 0);
    replace_file(path, std::as_bytes(std::span(text)));
    EXPECT_EQ(read_file(path, 100), text);
    struct stat status{};
    ASSERT_EQ(::stat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, mode);
  }
}

TEST_F(RegularFile, IsReplacedHoweverLongItsNameIs) {
  for (std::size_t size = NAME_MAX - 10; size <= NAME_MAX; ++size) {
    const std::filesystem::path folder = folder_.path() / std::to_string(size);
    std::filesystem::create_directory(folder);
    const std::filesystem::path path = folder / (std::string(size - 4, 'n') + ".new");
    for (const std::string text : {"before", "after"}) {
      replace_file(path, std::as_bytes(std::span(text)));
      EXPECT_EQ(read_file(path, 100), text);
    }
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder), {}), 1);
  }
}

TEST_F(RegularFile, IsReplacedWhereTheFileAloneIsMounted) {
  const std::filesystem::path path = file("before");
  const std::filesystem::path source = folder_.path() / "source";
  std::ofstream(source) << "longer than before";
  constexpr int kNotPermitted = 77;
  test::ChildProcess container([&] {
    if (::unshare(CLONE_NEWNS) != 0 ||
        ::mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        ::mount(source.c_str(), path.c_str(), nullptr, MS_BIND, nullptr) != 0) {
      return kNotPermitted;
    }
    const std::string text = "after";
    replace_file(path, std::as_bytes(std::span(text)));
    return 0;
  });
  const int status = container.wait();
  if (status == kNotPermitted) GTEST_SKIP() << "only an administrator may mount a file";
  EXPECT_EQ(status, 0);
  EXPECT_EQ(read_file(source, 100), "after");
  EXPECT_EQ(read_file(path, 100), "before");
  EXPECT_FALSE(std::filesystem::exists(path.string() + ".new"));
}

}  // namespace
}  // namespace trifinger
