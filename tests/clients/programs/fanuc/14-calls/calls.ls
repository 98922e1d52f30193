/PROG  CALLS
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "panel";
PROG_SIZE	= 612;
CREATE		= DATE 26-11-22  TIME 10:31:04;
LINE_COUNT	= 4;
DEFAULT_GROUP	= 1,*,*,*,*;
/APPL
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
   3:  CALL GRIP_OPEN     ;
   4:L P[1] 100mm/sec FINE     ;
   5:  WAIT    .50(sec) ;
   6:  IF R[1]=1,JMP LBL[2]     ;
   7:L P[2] 100mm/sec FINE TB .10sec,CALL CLOSE     ;
   8:  LBL[2]    ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    150.000  mm,	Z =       .000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
P[2]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =       .000  mm,	Y =    162.500  mm,	Z =       .000  mm,
	W =      .000 deg,	P =    90.000 deg,	R =      .000 deg
};
/END
