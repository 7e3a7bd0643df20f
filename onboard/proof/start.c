/* The program around the proof: entry and two system calls, no C library.
   x86-64 Linux: syscall numbers 1 (write) and 60 (exit), arguments in rdi, rsi, rdx. */
#if !defined(__x86_64__) || !defined(__linux__)
#error "this proof runs on x86-64 Linux only"
#endif

typedef __SIZE_TYPE__ size_t;

/* The four functions that Rust's core library asks of every platform. Those for microcontrollers
   ship them with the compiler; this one leaves them to libc, which is not here. Byte by byte in
   assembler, lest the compiler turn a loop into a call of the function it is in. */
void *memcpy(void *to, const void *from, size_t count)
{
    void *begin = to;
    __asm__ volatile("rep movsb" : "+D"(to), "+S"(from), "+c"(count) : : "memory");
    return begin;
}

void *memset(void *to, int byte, size_t count)
{
    void *begin = to;
    __asm__ volatile("rep stosb" : "+D"(to), "+c"(count) : "a"(byte) : "memory");
    return begin;
}

void *memmove(void *to, const void *from, size_t count)
{
    char *end = (char *)to + count;
    const char *from_end = (const char *)from + count;
    if ((size_t)to - (size_t)from >= count)
        return memcpy(to, from, count);
    while (end != to) {
        *--end = *--from_end;
        __asm__ volatile("" : : : "memory");
    }
    return to;
}

int memcmp(const void *left, const void *right, size_t count)
{
    const unsigned char *a = left, *b = right;
    for (; count > 0; a++, b++, count--)
        if (*a != *b)
            return *a - *b;
    return 0;
}

/* Null, or a sentence about the failure: see src/lib.rs. */
const char *onecycle_proof(void);

struct size {
    const char *name;
    size_t bytes;
};

/* Name and size of an object; the name is null after the last. */
struct size onecycle_proof_size(size_t index);

/* The kernel enters with the stack aligned to 16; a C function expects a call to have moved it. */
__asm__(".globl _start\n"
        "_start:\n"
        "    xor %ebp, %ebp\n"
        "    call onecycle_proof_main\n"
        "    ud2\n");

static long system_call(long number, long first, const void *second, long third)
{
    long result;
    __asm__ volatile("syscall"
                     : "=a"(result)
                     : "a"(number), "D"(first), "S"(second), "d"(third)
                     : "rcx", "r11", "memory");
    return result;
}

static void write_text(const char *text)
{
    long length = 0;
    while (text[length] != 0)
        length++;
    system_call(1, 1, text, length);
}

static void write_line(const char *line)
{
    write_text(line);
    write_text("\n");
}

static void write_size(const char *name, size_t bytes)
{
    char digits[24];
    char *first = digits + sizeof digits - 1;
    *first = 0;
    do
        *--first = (char)('0' + bytes % 10);
    while ((bytes /= 10) > 0);
    write_text(name);
    write_text(" ");
    write_line(first);
}

__attribute__((noreturn)) static void leave(long status)
{
    for (;;)
        system_call(60, status, 0, 0);
}

__attribute__((noreturn)) void onecycle_proof_panicked(void)
{
    write_line("panicked");
    leave(101);
}

/* The stack below the caller is painted; after the run its lowest changed byte is the high-water mark, 8 bytes
   more or less if the last value there equals the paint. */
enum { PAINT = 0xa5, PAINTED = 1 << 20, MARGIN = 64 };

__attribute__((noreturn, used)) void onecycle_proof_main(void)
{
    volatile unsigned char *top;
    __asm__ volatile("mov %%rsp, %0" : "=r"(top));
    volatile unsigned char *bottom = top - PAINTED;
    for (volatile unsigned char *at = top - MARGIN; at != bottom;)
        *--at = PAINT;
    const char *wrong = onecycle_proof();
    while (bottom != top && *bottom == PAINT)
        bottom++;
    write_line(wrong ? wrong : "ok");
    write_size("stack", (size_t)(top - bottom));
    struct size size;
    for (size_t index = 0; (size = onecycle_proof_size(index)).name; index++)
        write_size(size.name, size.bytes);
    leave(wrong ? 1 : 0);
}
