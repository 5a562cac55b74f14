/* Vectors and reset of the Cortex-M. */
    .syntax unified
    .thumb

    .section .vectors, "a"
    .global _vectors
_vectors:
    .word _stack_top
    .word reset_handler
    .rept 14                        /* NMI (the watchdog), faults, and what is not used */
    .word fault_handler
    .endr
    .word uart0_receive_handler     /* interrupt 0 */
    .word fault_handler
    .word uart1_receive_handler
    .word fault_handler
    .word uart2_receive_handler
    .word fault_handler
    .word fault_handler
    .word fault_handler
    .word timer0_handler            /* 8 */
    .rept 23
    .word fault_handler
    .endr

    .section .text.reset_handler, "ax"
    .global reset_handler
    .type reset_handler, %function
reset_handler:
    ldr r0, =0xE000ED14             /* CCR: a division by zero is a fault, not a silent 0 */
    ldr r1, [r0]
    orr r1, r1, #(1 << 4)
    str r1, [r0]
    ldr r0, =start_program
    bx  r0

    .section .text.fault_handler, "ax"
    .type fault_handler, %function
fault_handler:
    mov r0, sp
    ldr sp, =_fault_stack_top       /* the fault may be that the stack overflowed */
    ldr r1, =record_fault
    bx  r1

/* An image that does not use a device need not know its interrupt. */
    .weak uart0_receive_handler, uart1_receive_handler, uart2_receive_handler, timer0_handler
    .set uart0_receive_handler, fault_handler
    .set uart1_receive_handler, fault_handler
    .set uart2_receive_handler, fault_handler
    .set timer0_handler, fault_handler
