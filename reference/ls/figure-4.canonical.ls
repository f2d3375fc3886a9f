/PROG  FanucTest2_tdMax05tdMin005
/ATTR
COMMENT		= "FanucTest2_tdMax";
/APPL
/MN
   1:  UTOOL_NUM=1 ;
   2:  UFRAME_NUM=0 ;
   3:J P[1] 2% CNT100    ;
   4:S P[2] 10mm/sec CNT100    ;
   5:S P[3] 31mm/sec CNT100    ;
/POS
P[1]{
   GP1:
	UF : 0, UT : 1,	
	J1=  -108.435 deg,	J2=   -11.185 deg,	J3=     5.382 deg,
	J4=     0.000 deg,	J5=    84.618 deg,	J6=  -288.435 deg
};
P[2]{
   GP1:
	UF : 0, UT : 1,	
	J1=  -108.347 deg,	J2=   -11.231 deg,	J3=     5.392 deg,
	J4=      .039 deg,	J5=    84.492 deg,	J6=  -288.351 deg
};
P[3]{
   GP1:
	UF : 0, UT : 1,	
	J1=  -107.795 deg,	J2=   -11.516 deg,	J3=     5.452 deg,
	J4=      .272 deg,	J5=    83.706 deg,	J6=  -287.822 deg
};
P[4]{
   GP1:
	UF : 0, UT : 1,	
	J1=  -106.663 deg,	J2=   -12.074 deg,	J3=     5.581 deg,
	J4=      .700 deg,	J5=    82.104 deg,	J6=  -286.745 deg
};
P[5]{
   GP1:
	UF : 0, UT : 1,	
	J1=  -104.913 deg,	J2=   -12.874 deg,	J3=     5.790 deg,
	J4=     1.234 deg,	J5=    79.648 deg,	J6=  -285.086 deg
};
/END
