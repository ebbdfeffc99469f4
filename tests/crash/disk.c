/* A disk that can be asked to fail, and that remembers what was written and what was synced.
 *
 * Preloaded (LD_PRELOAD) into a process; it minds only files below the folder named by DISK_DIR.
 * disk_fail(n, error, lasting): the n-th call from now fails with this errno, or all from there on.
 * disk_log(fd): every change is written to this descriptor as
 *     char kind, uint64 inode, int64 offset, uint32 length, length bytes
 * kind: w write, t truncate to offset, s sync, n name (bytes: path), u unnamed, m mark (offset).
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#define MOST 4096
static char minded[MOST];
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static long calls, fail_at = -1;
static int fail_with, fail_lasting, log_fd = -1, unwritten;

static int ours(const char *path) {
    const char *dir = getenv("DISK_DIR");
    return dir && path && strncmp(path, dir, strlen(dir)) == 0;
}
static int fd_ours(int fd) { return fd >= 0 && fd < MOST && minded[fd]; }

static int failing(void) {
    int out = 0;
    pthread_mutex_lock(&lock);
    calls++;
    if (fail_at >= 0 && (calls == fail_at || (fail_lasting && calls > fail_at))) {
        errno = fail_with;
        out = 1;
    }
    pthread_mutex_unlock(&lock);
    return out;
}
void disk_fail(long n, int error, int lasting) {
    calls = 0; fail_at = n; fail_with = error; fail_lasting = lasting;
}
long disk_calls(void) { return calls; }
void disk_log(int fd) { log_fd = fd; }

static void put(char kind, uint64_t inode, int64_t offset, const void *data, uint32_t length) {
    if (log_fd < 0) return;
    char head[21];
    pthread_mutex_lock(&lock);
    head[0] = kind;
    memcpy(head + 1, &inode, 8); memcpy(head + 9, &offset, 8); memcpy(head + 17, &length, 4);
    unwritten += syscall(SYS_write, log_fd, head, sizeof head) < 0;
    if (length) unwritten += syscall(SYS_write, log_fd, data, length) < 0;
    pthread_mutex_unlock(&lock);
}
void disk_mark(long n) { put('m', 0, n, NULL, 0); }
static uint64_t inode_of(int fd) {
    struct stat s;
    return fstat(fd, &s) ? 0 : s.st_ino;
}
static uint64_t inode_at(const char *path) {
    struct stat s;
    return stat(path, &s) ? 0 : s.st_ino;
}
#define REAL(type, name, ...) \
    static type (*real)(__VA_ARGS__); \
    if (!real) real = dlsym(RTLD_NEXT, name)

static int opened(int fd, const char *path) {
    if (fd >= 0 && fd < MOST) {
        minded[fd] = ours(path);
        if (minded[fd]) put('n', inode_of(fd), 0, path, strlen(path));
    }
    return fd;
}
#define OPEN(symbol, text) \
    int symbol(const char *path, int flags, ...) { \
        REAL(int, text, const char *, int, ...); \
        va_list more; va_start(more, flags); int mode = va_arg(more, int); va_end(more); \
        if (ours(path) && failing()) return -1; \
        return opened(real(path, flags, mode), path); \
    }
OPEN(open, "open")
OPEN(open64, "open64")
#define OPENAT(symbol, text) \
    int symbol(int at, const char *path, int flags, ...) { \
        REAL(int, text, int, const char *, int, ...); \
        va_list more; va_start(more, flags); int mode = va_arg(more, int); va_end(more); \
        if (ours(path) && failing()) return -1; \
        return opened(real(at, path, flags, mode), path); \
    }
OPENAT(openat, "openat")
OPENAT(openat64, "openat64")

int close(int fd) {
    REAL(int, "close", int);
    if (fd >= 0 && fd < MOST) minded[fd] = 0;
    return real(fd);
}
ssize_t write(int fd, const void *data, size_t n) {
    REAL(ssize_t, "write", int, const void *, size_t);
    if (!fd_ours(fd)) return real(fd, data, n);
    if (failing()) return -1;
    off_t at = lseek(fd, 0, SEEK_CUR);
    ssize_t done = real(fd, data, n);
    if (done > 0) put('w', inode_of(fd), at, data, done);
    return done;
}
#define PWRITE(symbol, text) \
    ssize_t symbol(int fd, const void *data, size_t n, off_t at) { \
        REAL(ssize_t, text, int, const void *, size_t, off_t); \
        if (fd_ours(fd) && failing()) return -1; \
        ssize_t done = real(fd, data, n, at); \
        if (fd_ours(fd) && done > 0) put('w', inode_of(fd), at, data, done); \
        return done; \
    }
PWRITE(pwrite, "pwrite")
PWRITE(pwrite64, "pwrite64")
#define PREAD(symbol, text) \
    ssize_t symbol(int fd, void *data, size_t n, off_t at) { \
        REAL(ssize_t, text, int, void *, size_t, off_t); \
        if (fd_ours(fd) && failing()) return -1; \
        return real(fd, data, n, at); \
    }
PREAD(pread, "pread")
PREAD(pread64, "pread64")
#define TRUNCATE(symbol, text) \
    int symbol(int fd, off_t size) { \
        REAL(int, text, int, off_t); \
        if (fd_ours(fd) && failing()) return -1; \
        int done = real(fd, size); \
        if (fd_ours(fd) && !done) put('t', inode_of(fd), size, NULL, 0); \
        return done; \
    }
TRUNCATE(ftruncate, "ftruncate")
TRUNCATE(ftruncate64, "ftruncate64")
#define SYNC(symbol, text) \
    int symbol(int fd) { \
        REAL(int, text, int); \
        if (fd_ours(fd) && failing()) return -1; \
        int done = real(fd); \
        if (fd_ours(fd) && !done) put('s', inode_of(fd), 0, NULL, 0); \
        return done; \
    }
SYNC(fsync, "fsync")
SYNC(fdatasync, "fdatasync")
int unlink(const char *path) {
    REAL(int, "unlink", const char *);
    if (ours(path) && failing()) return -1;
    uint64_t inode = ours(path) ? inode_at(path) : 0;
    int done = real(path);
    if (ours(path) && !done) put('u', inode, 0, path, strlen(path));
    return done;
}
static int linked(int done, const char *to) {
    if (ours(to) && !done) put('n', inode_at(to), 0, to, strlen(to));
    return done;
}
int link(const char *from, const char *to) {
    REAL(int, "link", const char *, const char *);
    if (ours(to) && failing()) return -1;
    return linked(real(from, to), to);
}
int linkat(int a, const char *from, int b, const char *to, int flags) {
    REAL(int, "linkat", int, const char *, int, const char *, int);
    if (ours(to) && failing()) return -1;
    return linked(real(a, from, b, to, flags), to);
}
