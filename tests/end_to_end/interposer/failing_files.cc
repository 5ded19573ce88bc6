// A library to load with LD_PRELOAD that sees every call by which a process changes a folder, and
// lets one of them fail, or kills the process there. So a test can try each step of what the
// program does to its output folder, without a broken disk and without luck.
//
// EVENTGAN_FAILING_FOLDER  the folder to watch, absolute and without symbolic links
// EVENTGAN_FAILING_LOG     a file outside of it that gets a line for each call, with tabs between:
//                          KIND, PATH and, if the rule struck, its ACTION
// EVENTGAN_FAILING_RULE    "ACTION KIND NUMBER": what to do at which call of a kind, counted from 1
//
//   KIND    open and shut (of a file that is read), create, write, sync, close (of a writable
//   file),
//           truncate, rename, link, unlink, mkdir, or any (all but open and shut)
//   NUMBER  "7": the seventh; "7+": it and all after it, like a disk that stays full
//   ACTION  kill-before, kill-after   SIGKILL, the call not made or just made
//           kill-within               SIGKILL after half of the bytes of a write
//           kill-later                SIGKILL from another thread, some time after the call has
//                                     begun: "kill-later any 7 500" waits 500 microseconds
//           SIGTERM, SIGINT, SIGUSR1  the process gets the signal, then the call is made
//           ENOSPC, EIO,              the call fails so; a write has written half of its bytes;
//           EDQUOT, EROFS             unlink is spared by "any": a full disk lets files go
//           short                     a write takes half of its bytes and says so
//
// The functions are those that libhdf5 (open, pwrite, ftruncate, close), libstdc++ (fopen64, write,
// writev, fclose, rename, remove, mkdir, ...) and the program call. What the C library does within
// itself is not seen: bytes through fwrite() are not counted, their fopen() and fclose() are.

#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <filesystem>
#include <string>
#include <string_view>

#include "tests/end_to_end/interposer/failure_rule.h"

namespace {

using eventgan::interposer::announce;
using eventgan::interposer::CallKind;
using eventgan::interposer::is_watched;
using eventgan::interposer::kill_process;
using eventgan::interposer::Order;

/// The function that this library interposes; `Function` as in decltype(::close).
template <class Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

std::string text_of_link(const std::string& link) {
  char text[PATH_MAX];
  const ssize_t size = ::readlink(link.c_str(), text, sizeof(text));
  return size < 0 ? "" : std::string(text, static_cast<std::size_t>(size));
}

std::string path_of(int descriptor) {
  return text_of_link("/proc/self/fd/" + std::to_string(descriptor));
}

std::string path_of(int folder, const char* path) {
  if (path[0] == '/') return std::filesystem::path(path).lexically_normal();
  const std::string base = folder == AT_FDCWD ? text_of_link("/proc/self/cwd") : path_of(folder);
  return (std::filesystem::path(base) / path).lexically_normal();
}

std::string path_of(const char* path) { return path_of(AT_FDCWD, path); }

/// Makes a call as the rule says.
template <class Result, class Call>
Result obey(CallKind kind, const std::string& path, Result failure, Call&& call) {
  if (!is_watched(path)) return call();
  const Order order = announce(kind, path);
  if (order.error != 0) {
    errno = order.error;
    return failure;
  }
  const Result result = call();
  if (order.kill) kill_process();
  return result;
}

/// A write of which half may be made; `write(size)` makes one of `size` bytes.
template <class Write>
ssize_t obey_write(int descriptor, std::size_t size, Write&& write) {
  const int error_before = errno;
  const std::string path = path_of(descriptor);
  errno = error_before;
  if (!is_watched(path)) return write(size);
  const Order order = announce(CallKind::kWrite, path);
  const bool halve = order.error != 0 || (order.shorten && size > 1);
  const ssize_t written = write(halve ? size / 2 : size);
  if (order.kill) kill_process();
  if (order.error == 0) return written;
  errno = order.error;
  return -1;
}

/// A close that fails has closed all the same, as Linux does it.
template <class Close>
int obey_close(int descriptor, int failure, Close&& close) {
  const int error_before = errno;
  const int flags = ::fcntl(descriptor, F_GETFL);
  const bool writable = flags >= 0 && (flags & O_ACCMODE) != O_RDONLY;
  const std::string path = path_of(descriptor);
  errno = error_before;
  if (!is_watched(path)) return close();
  const Order order = announce(writable ? CallKind::kClose : CallKind::kShut, path);
  const int result = close();
  if (order.kill) kill_process();
  if (order.error == 0) return result;
  errno = order.error;
  return failure;
}

CallKind kind_of_open(int flags) {
  const bool changes = (flags & O_ACCMODE) != O_RDONLY || (flags & O_CREAT) != 0;
  return changes ? CallKind::kCreate : CallKind::kOpen;
}

CallKind kind_of_open(const char* mode) {
  const bool reads = std::string_view(mode).find_first_of("wa+") == std::string_view::npos;
  return reads ? CallKind::kOpen : CallKind::kCreate;
}

mode_t mode_argument(int flags, va_list arguments) {
  const bool given = (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE;
  return given ? va_arg(arguments, mode_t) : 0;
}

}  // namespace

#define EVENTGAN_OPEN(name)                                                                  \
  int name(const char* path, int flags, ...) {                                               \
    va_list arguments;                                                                       \
    va_start(arguments, flags);                                                              \
    const mode_t mode = mode_argument(flags, arguments);                                     \
    va_end(arguments);                                                                       \
    return obey(kind_of_open(flags), path_of(path), -1,                                      \
                [&] { return next<int(const char*, int, ...)>(#name)(path, flags, mode); }); \
  }

#define EVENTGAN_OPENAT(name)                                                         \
  int name(int folder, const char* path, int flags, ...) {                            \
    va_list arguments;                                                                \
    va_start(arguments, flags);                                                       \
    const mode_t mode = mode_argument(flags, arguments);                              \
    va_end(arguments);                                                                \
    return obey(kind_of_open(flags), path_of(folder, path), -1, [&] {                 \
      return next<int(int, const char*, int, ...)>(#name)(folder, path, flags, mode); \
    });                                                                               \
  }

#define EVENTGAN_FOPEN(name)                                                                      \
  FILE* name(const char* path, const char* mode) {                                                \
    return obey<FILE*>(kind_of_open(mode), path_of(path), nullptr,                                \
                       [&] { return next<FILE*(const char*, const char*)>(#name)(path, mode); }); \
  }

#define EVENTGAN_PWRITE(name)                                                                  \
  ssize_t name(int file, const void* bytes, size_t size, off_t offset) {                       \
    return obey_write(file, size, [&](size_t part) {                                           \
      return next<ssize_t(int, const void*, size_t, off_t)>(#name)(file, bytes, part, offset); \
    });                                                                                        \
  }

#define EVENTGAN_OF_DESCRIPTOR(name, kind)                                                       \
  int name(int file) {                                                                           \
    return obey(CallKind::kind, path_of(file), -1, [&] { return next<int(int)>(#name)(file); }); \
  }

#define EVENTGAN_FTRUNCATE(name)                                           \
  int name(int file, off_t size) noexcept {                                \
    return obey(CallKind::kTruncate, path_of(file), -1,                    \
                [&] { return next<int(int, off_t)>(#name)(file, size); }); \
  }

extern "C" {

EVENTGAN_OPEN(open)
EVENTGAN_OPEN(open64)
EVENTGAN_OPENAT(openat)
EVENTGAN_OPENAT(openat64)
EVENTGAN_FOPEN(fopen)
EVENTGAN_FOPEN(fopen64)

ssize_t write(int file, const void* bytes, size_t size) {
  return obey_write(file, size, [&](size_t part) {
    return next<ssize_t(int, const void*, size_t)>("write")(file, bytes, part);
  });
}

EVENTGAN_PWRITE(pwrite)
EVENTGAN_PWRITE(pwrite64)

/// Halved, it takes the first of its parts alone.
ssize_t writev(int file, const iovec* parts, int count) {
  std::size_t size = 0;
  for (int i = 0; i < count; ++i) size += parts[i].iov_len;
  return obey_write(file, size, [&](size_t part) {
    return next<ssize_t(int, const iovec*, int)>("writev")(file, parts, part < size ? 1 : count);
  });
}

EVENTGAN_OF_DESCRIPTOR(fsync, kSync)
EVENTGAN_OF_DESCRIPTOR(fdatasync, kSync)

int close(int file) {
  return obey_close(file, -1, [&] { return next<int(int)>("close")(file); });
}

int fclose(FILE* stream) {
  return obey_close(::fileno(stream), EOF, [&] { return next<int(FILE*)>("fclose")(stream); });
}

EVENTGAN_FTRUNCATE(ftruncate)
EVENTGAN_FTRUNCATE(ftruncate64)

int rename(const char* from, const char* to) noexcept {
  return obey(CallKind::kRename, path_of(to), -1,
              [&] { return next<int(const char*, const char*)>("rename")(from, to); });
}

int renameat(int from_folder, const char* from, int to_folder, const char* to) noexcept {
  return obey(CallKind::kRename, path_of(to_folder, to), -1, [&] {
    return next<int(int, const char*, int, const char*)>("renameat")(from_folder, from, to_folder,
                                                                     to);
  });
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to,
              unsigned flags) noexcept {
  return obey(CallKind::kRename, path_of(to_folder, to), -1, [&] {
    return next<int(int, const char*, int, const char*, unsigned)>("renameat2")(
        from_folder, from, to_folder, to, flags);
  });
}

int link(const char* from, const char* to) noexcept {
  return obey(CallKind::kLink, path_of(to), -1,
              [&] { return next<int(const char*, const char*)>("link")(from, to); });
}

int unlink(const char* path) noexcept {
  return obey(CallKind::kUnlink, path_of(path), -1,
              [&] { return next<int(const char*)>("unlink")(path); });
}

int unlinkat(int folder, const char* path, int flags) noexcept {
  return obey(CallKind::kUnlink, path_of(folder, path), -1,
              [&] { return next<int(int, const char*, int)>("unlinkat")(folder, path, flags); });
}

int remove(const char* path) noexcept {
  return obey(CallKind::kUnlink, path_of(path), -1,
              [&] { return next<int(const char*)>("remove")(path); });
}

int mkdir(const char* path, mode_t mode) noexcept {
  return obey(CallKind::kMkdir, path_of(path), -1,
              [&] { return next<int(const char*, mode_t)>("mkdir")(path, mode); });
}

}  // extern "C"
